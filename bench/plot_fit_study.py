#!/usr/bin/python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
"""The plots of docs/fit-in-pictures.md from the tables of fit_study and fit_time_study.

    bench/plot_fit_study.py TABLE.csv... FOLDER

Needs Debian's python3-matplotlib.
"""
import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

THESIS, JOINT, REALTIME, GREY = "#2166ac", "#d95f02", "#1b7837", "#7f7f7f"
DPI = 110

plt.rcParams.update({
    "font.size": 9, "axes.titlesize": 9.5, "legend.fontsize": 7.5, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": "#e4e4e4", "lines.linewidth": 1.5, "lines.markersize": 4, "legend.frameon": False,
})


def read_tables(paths):
    """{(part, quantity): {series: [(x, mean, error), ...]}}"""
    tables = {}
    for path in paths:
        with open(path, newline="") as file:
            rows = csv.DictReader(line for line in file if not line.startswith("#"))
            for row in rows:
                lines = tables.setdefault((row["part"], row["quantity"]), {})
                lines.setdefault(row["series"], []).append(tuple(float(row[key]) for key in ("x", "mean", "error")))
    return tables


def draw(axes, line, **style):
    x, mean, error = zip(*sorted(line))
    axes.errorbar(x, mean, yerr=error, capsize=2, elinewidth=0.8, **style)


def save(figure, folder, name):
    figure.tight_layout()
    path = folder / name
    figure.savefig(path, dpi=DPI, pil_kwargs={"optimize": True})
    plt.close(figure)
    print(f"{path}: {path.stat().st_size // 1024} kB")


def plot_convergence(tables, folder):
    figure, panels = plt.subplots(2, 2, figsize=(9.2, 6.6))
    panels = panels.ravel()
    quantities = [("error_mm", "error of the neutral shape [mm]"), ("rms_px", "landmark distance, r.m.s. [px]"),
                  ("to_limit_mm", "vertex distance to the end result [mm]"),
                  ("energy", "energy above that of the end result [1]")]
    thin = {"to_limit_mm": ["to_limit_but_for_scale_mm"], "energy": ["energy_at_end_scale", "energy_but_slowest"]}
    panels[2].set_title("thin: after a similarity")
    panels[3].set_title("thin: noise at the final scale (thesis),\nwithout the slowest face (joint)")
    for axes, (quantity, label) in zip(panels, quantities):
        for method, color in (("thesis", THESIS), ("joint", JOINT)):
            for outline, marker, line_style in (("fixed", "o", "--"), ("re-matched", "s", "-")):
                series = f"{method}, outline {outline}"
                if series in tables["convergence", quantity]:
                    draw(axes, tables["convergence", quantity][series], color=color, marker=marker,
                         linestyle=line_style, label=series)
                for name in thin.get(quantity, []):
                    if series in tables["convergence", name]:
                        draw(axes, tables["convergence", name][series], color=color, linestyle=line_style,
                             linewidth=0.8)
        axes.set_xscale("log")
        axes.set_xlim(0.85, 240)
        axes.set_xticks([1, 2, 3, 5, 10, 20, 50, 100, 200], ["1", "2", "3", "5", "10", "20", "50", "100", "200"])
        axes.minorticks_off()
        axes.set_xlabel("iterations (thesis) or steps (joint)")
        axes.set_ylabel(label)
    for axes, least in ((panels[2], 1e-4), (panels[3], 1e-6)):
        axes.set_yscale("log")
        axes.set_ylim(least, None)
    panels[0].legend(handlelength=3)
    save(figure, folder, "fit-convergence.png")


def plot_time(tables, folder):
    lines = tables["time", "ratio"]
    calibration_us = tables["time", "median_us"]["calibration"][0][1]
    figure, axes = plt.subplots(figsize=(8.2, 4.2))
    markers = {}
    for series in sorted(lines, key=lambda name: (name.split(",")[0], int("0" + "".join(filter(str.isdigit, name))))):
        if series == "calibration" or "facing" in series:
            continue
        fitter, size = series.split(", ")
        marker = markers.setdefault(size, "ovs"[len(markers) % 3])
        color = {"FaceFitter": THESIS, "RealtimeFitter": REALTIME, "JointFitter": JOINT}[fitter]
        draw(axes, tables["time", "median_us"][series], color=color, marker=marker, label=series,
             linestyle="" if fitter == "JointFitter" else "-")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks([1, 2, 3, 5, 10, 20], ["1", "2", "3", "5", "10", "20"])
    axes.set_yticks([20, 50, 100, 200, 500, 1000, 2000, 5000], ["20", "50", "100", "200", "500", "1000", "2000", "5000"])
    axes.minorticks_off()
    axes.set_xlabel("iterations (JointFitter: steps taken, mean)")
    axes.set_ylabel("processor time of a fit [µs]")
    ratio = axes.secondary_yaxis("right", functions=(lambda t: t / calibration_us, lambda r: r * calibration_us))
    ratio.set_ylabel(f"ratio to the calibration kernel ({calibration_us:.0f} µs)")
    ratio.set_yticks([0.5, 1, 2, 5, 10, 20, 40], ["0.5", "1", "2", "5", "10", "20", "40"])
    ratio.minorticks_off()
    ratio.spines["right"].set_visible(True)
    axes.legend(loc="center left", bbox_to_anchor=(1.14, 0.5))
    save(figure, folder, "fit-time.png")


POSES = [("affine", GREY, ":", "^"), ("scaled orthographic, closed form", THESIS, "-", "o"),
         ("scaled orthographic, minimiser", REALTIME, "--", "s"), ("perspective, focal length known", JOINT, "-", "D")]


def plot_pose(tables, folder):
    figure, panels = plt.subplots(1, 3, figsize=(10.5, 3.4))
    titles = [("known_noise", "true shape known, camera far away", "noise of a landmark coordinate [px]"),
              ("known_distance", "true shape known, noise 1 px", "distance of the camera [mm]"),
              ("mean_distance", "mean face, noise 1 px", "distance of the camera [mm]")]
    for axes, (quantity, title, label) in zip(panels, titles):
        for series, color, line_style, marker in POSES:
            draw(axes, tables["pose", quantity][series], color=color, linestyle=line_style, marker=marker, label=series)
        axes.set_title(title)
        axes.set_xlabel(label)
        axes.set_ylabel("angle of the rotation error [deg]")
        axes.set_ylim(0, None)
        if "distance" in quantity:
            axes.set_xscale("log")
            axes.set_xticks([300, 500, 1000, 2500, 5000], ["300", "500", "1000", "2500", "5000"])
            axes.minorticks_off()
    panels[0].legend()
    save(figure, folder, "fit-pose.png")


def plot_parts(tables, folder):
    figure, panels = plt.subplots(1, 3, figsize=(10.5, 3.3))
    series = [("psi >= 0", THESIS, "-", "o", "ψ ≥ 0"), ("psi free", "#c51b7d", "-", "v", "ψ free"),
              ("psi >= 0, affine camera", GREY, ":", "^", "ψ ≥ 0, affine camera")]
    quantities = [("neutral_mm", "error of the neutral shape [mm]"), ("face_mm", "error of the face with expression [mm]"),
                  ("psi_rms", "error of ψ, r.m.s. [1]")]
    for axes, (quantity, label) in zip(panels, quantities):
        for name, color, line_style, marker, text in series:
            draw(axes, tables["parts", quantity][name], color=color, linestyle=line_style, marker=marker, label=text)
        axes.set_xlabel("noise of a landmark coordinate [px]")
        axes.set_ylabel(label)
    panels[2].set_ylim(0, None)
    panels[0].legend(loc="center right", bbox_to_anchor=(1.0, 0.6))
    save(figure, folder, "fit-nonnegative.png")


def plot_contours(tables, folder):
    figure, panels = plt.subplots(1, 2, figsize=(8.6, 3.4), sharey=True)
    modes = [("ignored", GREY, ":", "x"), ("fixed", "#b2182b", "--", "v"), ("front-facing", "#35978f", "-.", "^"),
             ("occluding", "#9970ab", "--", "s"), ("both", "black", "-", "o"),
             ("both, thesis's rule", THESIS, ":", "D")]
    for axes, method in zip(panels, ("thesis", "joint")):
        for mode, color, line_style, marker in modes:
            if mode not in tables["contour", f"{method}_mm"]:
                continue
            draw(axes, tables["contour", f"{method}_mm"][mode], color=color, linestyle=line_style, marker=marker,
                 label=mode)
        axes.set_title("thesis (FaceFitter)" if method == "thesis" else "joint (JointFitter)",
                       color=THESIS if method == "thesis" else JOINT)
        axes.set_xlabel("yaw [deg]")
    panels[0].set_ylabel("error of the neutral shape [mm]")
    panels[0].legend()
    save(figure, folder, "fit-contour-error.png")


def plot_errors(tables, folder):
    figure, panels = plt.subplots(1, 3, figsize=(10.5, 3.4), sharey=True)
    series = [("mean face", GREY, ":", None), ("thesis, published setting", THESIS, "--", "^"),
              ("thesis, default", THESIS, "-", "o"), ("joint, default", JOINT, "-", "s"),
              ("joint, noise known", JOINT, "--", "D")]
    for axes, (quantity, label) in zip(panels, (("noise", "noise of a landmark coordinate [px]"),
                                                ("images", "images of a person"), ("yaw", "yaw [deg]"))):
        for name, color, line_style, marker in series:
            draw(axes, tables["error", quantity][name], color=color, linestyle=line_style, marker=marker, label=name)
        axes.set_xlabel(label)
        axes.set_ylim(0, None)
    panels[1].set_xscale("log")
    panels[1].set_xticks([1, 2, 3, 5, 10, 20], ["1", "2", "3", "5", "10", "20"])
    panels[1].minorticks_off()
    panels[0].set_ylabel("error of the neutral shape [mm]")
    panels[2].legend(loc="lower right")
    save(figure, folder, "fit-error.png")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    tables = read_tables(sys.argv[1:-1])
    folder = Path(sys.argv[-1])
    folder.mkdir(parents=True, exist_ok=True)
    parts = {part for part, _ in tables}
    for part, plot in (("convergence", plot_convergence), ("time", plot_time), ("pose", plot_pose), ("parts", plot_parts),
                       ("contour", plot_contours), ("error", plot_errors)):
        if part in parts:
            plot(tables, folder)


main()
