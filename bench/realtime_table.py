#!/usr/bin/python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
"""A Markdown table, and a plot, of what realtime_bench measured in one run.

    bench/realtime_table.py FILE.json [--set NAME] [--plot FILE.png]

FILE.json is what the program wrote with --benchmark_out; NAME is the instruction set, AVX2 say, else the first one.
Processor times, the median and the least of the repetitions. Ratios are of least times, which come out alike from run
to run even where neighbours on the same processor disturb half of the repetitions. The plot needs Debian's
python3-matplotlib.
"""
import argparse
import json
import statistics

# Name in the program: what to call it. The number is that of the expressions.
PARTS = {
    "front": "fit, facing contour, 6 expressions",
    "front_mesh": "with mesh",
    "front_mesh_single": "with mesh of single precision columns",
    "front_arkit47": "fit, facing contour, 47 expressions",
    "front_arkit47_mesh": "with mesh",
    "front_arkit47_mesh_single": "with mesh of single precision columns",
    "both_yaw30": "fit, both contours, 6 expressions",
    "both_yaw30_mesh": "with mesh",
    "both_yaw30_mesh_single": "with mesh of single precision columns",
    "joint_front": "`JointFitter`, facing contour, 6 expressions",
    "joint_front_mesh": "with mesh",
    "joint_front_arkit47": "`JointFitter`, facing contour, 47 expressions",
    "joint_front_arkit47_mesh": "with mesh",
    "joint_both_yaw30": "`JointFitter`, both contours, 6 expressions",
    "joint_both_yaw30_mesh": "with mesh",
    "joint_warm_ekman6": "`JointFitter` from the last result, 6",
    "joint_warm_arkit47": "`JointFitter` from the last result, 47",
    "joint_step_ekman6": "`JointFitter`, one step from the last result, without covariance, 6",
    "joint_step_arkit47": "`JointFitter`, one step from the last result, without covariance, 47",
    "joint_frozen_ekman6": "the same, identity frozen, and mesh, 6",
    "joint_frozen_arkit47": "the same, identity frozen, and mesh, 47",
    "joint_frames_10_ekman6": "`JointFitter::fit_frames` of 10 images, 6",
    "joint_frames_10_arkit47": "`JointFitter::fit_frames` of 10 images, 47",
    "joint_frames_10_step_ekman6": "one step of 10 images with a new matrix, 6",
    "joint_frames_10_step_arkit47": "one step of 10 images with a new matrix, 47",
    "joint_frames_10_kept_steps_ekman6": "two steps of 10 images with the matrix of the last, 6",
    "joint_frames_10_kept_steps_arkit47": "two steps of 10 images with the matrix of the last, 47",
    "joint_frames_64_ekman6": "`JointFitter::fit_frames` of 64 images, 6",
    "joint_frames_64_arkit47": "`JointFitter::fit_frames` of 64 images, 47",
    "joint_frames_64_step_ekman6": "one step of 64 images with a new matrix, 6",
    "joint_frames_64_step_arkit47": "one step of 64 images with a new matrix, 47",
    "joint_frames_64_kept_steps_ekman6": "two steps of 64 images with the matrix of the last, 6",
    "joint_frames_64_kept_steps_arkit47": "two steps of 64 images with the matrix of the last, 47",
    "warm_step_ekman6": "one iteration from the last result, 6",
    "warm_step_arkit47": "one iteration from the last result, 47",
    "frozen_ekman6": "one iteration, identity frozen, 6",
    "frozen_mesh_ekman6": "with mesh",
    "frozen_arkit47": "one iteration, identity frozen, 47",
    "frozen_mesh_arkit47": "with mesh",
    "sweep_10_ekman6": "`fit_frames` of 10 images, 6",
    "sweep_10_arkit47": "`fit_frames` of 10 images, 47",
    "sweep_100_ekman6": "`fit_frames` of 100 images, 6",
    "sweep_100_arkit47": "`fit_frames` of 100 images, 47",
    "mesh_ekman6": "mesh alone, 6",
    "mesh_arkit47": "mesh alone, 47",
    "mesh_single_ekman6": "mesh alone, columns of single precision, 6",
    "mesh_single_arkit47": "mesh alone, columns of single precision, 47",
    "mesh_of_frozen_ekman6": "mesh alone, identity frozen, 6",
    "mesh_of_frozen_arkit47": "mesh alone, identity frozen, 47",
    "mesh_batch_ekman6": "`shapes_of`, 64 meshes, 6",
    "mesh_batch_arkit47": "`shapes_of`, 64 meshes, 47",
    "multiply_rows": "68 points evaluated",
    "combine_grams": "sum of six Gram matrices",
    "add_gram": "Gram matrix of 32 rows of 64",
    "solve_positive": "solve in 60 unknowns",
    "joint_gram": "Gram matrix of 136 rows of 72, a step of `JointFitter`",
    "factor_and_invert": "its factor, with the inverse",
}


class Run:
    """Repetitions by name: processor times [us], and what else the program says."""

    def __init__(self, path):
        with open(path) as file:
            content = json.load(file)
        self.context = content["context"]
        self.entries = {}
        for entry in content["benchmarks"]:
            if entry["run_type"] == "iteration":
                assert entry["time_unit"] == "us"
                self.entries.setdefault(entry["run_name"], []).append(entry)

    def times(self, name):
        return [entry["cpu_time"] for entry in self.entries[name]]

    def least(self, name):
        """None if it was not measured."""
        return min(self.times(name)) if name in self.entries else None

    def spread(self, name):
        """Half the distance between the quartiles over the median."""
        low, middle, high = statistics.quantiles(self.times(name), n=4)
        return 0.5 * (high - low) / middle

    def first_set(self):
        sets = (name.split("/")[0] for name in self.entries if name.endswith("/front"))
        return next(name for name in sets if name != "reference")


class Row:
    def __init__(self, run, kernels, part):
        name, limit = f"{kernels}/{part}", f"{kernels}/limit/{part}"
        self.text = PARTS[part]
        self.median = statistics.median(run.times(name))
        self.least = run.least(name)
        self.spread = run.spread(name)
        self.reference = run.least("reference/" + part.replace("_single", ""))
        self.limit = run.least(limit)
        if self.limit:
            self.limit_kind = run.entries[limit][0]["label"]
            counter, unit = {"reading": ("bytes", "GB/s"), "arithmetic": ("flop", "GFLOPS")}[self.limit_kind]
            self.limit_rate = f"{max(entry[counter] for entry in run.entries[limit]) / 1e9:.0f} {unit}"


def digits(value, count=3):
    """`count` significant digits, never as 1e+03."""
    return f"{float(f'{value:.{count}g}'):g}"


def print_table(run, kernels, rows):
    print("| part | median, µs | least, µs | ratio to the kernel | double precision: times | of the limit | limit |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for row in rows:
        cells = [row.text, digits(row.median), digits(row.least), digits(row.least / run.least("calibration"), 2),
                 digits(row.reference / row.least, 2) if row.reference else "",
                 f"{100 * row.limit / row.least:.0f} %" if row.limit else "",
                 f"{row.limit_kind}, {row.limit_rate}" if row.limit else ""]
        print("| " + " | ".join(cells) + " |")
    load = ", ".join(f"{value:.1f}" for value in run.context.get("load_avg", []))
    calibration = run.times("calibration")
    spreads = [row.spread for row in rows]
    print(f"\n{kernels}, {len(calibration)} repetitions, load before the run {load} on {run.context['num_cpus']} "
          f"cores, calibration kernel {statistics.median(calibration):.0f} µs, at least {min(calibration):.0f}; half the "
          f"distance between the quartiles: {100 * statistics.median(spreads):.0f} % of the time in the middle of the "
          f"parts, {100 * max(spreads):.0f} % at most")


def plot(run, rows, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 9, "legend.fontsize": 8, "axes.spines.top": False, "axes.spines.right": False,
                         "legend.frameon": False})
    calibration = run.least("calibration")
    height = 0.22 * len(rows) + 1.2
    figure, axes = plt.subplots(figsize=(9, height))
    for i, row in enumerate(rows):
        ratio = row.least / calibration
        if row.reference:
            axes.plot([ratio, row.reference / calibration], [i, i], color="#c9d9ea", linewidth=4, zorder=1)
            axes.plot(row.reference / calibration, i, "s", color="#2166ac", zorder=2)
        axes.plot(ratio, i, "o", color="#1b7837", zorder=3)
        if row.limit:
            axes.plot([row.limit / calibration, ratio], [i, i], color="#d5e8d4", linewidth=4, zorder=1)
            axes.plot(row.limit / calibration, i, "|", color="black", markersize=9, markeredgewidth=2, zorder=2)
    axes.plot([], [], "s", color="#2166ac", label="double precision")
    axes.plot([], [], "o", color="#1b7837", label="real-time")
    axes.plot([], [], "|", color="black", markersize=9, markeredgewidth=2, label="limit measured in the same run")
    axes.set_yticks(range(len(rows)), [row.text.replace("`", "") for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xscale("log")
    axes.grid(axis="x", color="#e4e4e4")
    axes.set_axisbelow(True)
    axes.set_xlabel(f"least time, ratio to that of the calibration kernel ({calibration:.0f} µs)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.4, 1 + 0.4 / height), ncol=3)
    figure.tight_layout()
    figure.savefig(path, dpi=110, pil_kwargs={"optimize": True})


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file")
    parser.add_argument("--set")
    parser.add_argument("--plot")
    arguments = parser.parse_args()
    run = Run(arguments.file)
    if len(run.times("calibration")) < 2:
        parser.error("the run has no repetitions: --benchmark_repetitions=15")
    kernels = arguments.set or run.first_set()
    rows = [Row(run, kernels, part) for part in PARTS if f"{kernels}/{part}" in run.entries]
    print_table(run, kernels, rows)
    if arguments.plot:
        plot(run, rows, arguments.plot)


main()
