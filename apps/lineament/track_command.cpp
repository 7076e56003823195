// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"
#include "inputs.hpp"
#include "model_options.hpp"
#include "video_tracker.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace lineament::cli {

namespace {

using Json = nlohmann::ordered_json;

struct Options
{
    std::vector<std::string> inputs;
    std::string output = ".";
    bool json = false;
    TrackOptions track;
};

/// @throws Failure(system_failed) if a result would be written over a video or the model.
void protect_inputs(const Options& options, const std::vector<Job>& jobs)
{
    std::vector<std::filesystem::path> read = {model_path_or_default(options.track.model.model)};
    std::vector<std::filesystem::path> written;
    for (const Job& job : jobs) {
        read.push_back(job.input);
        const std::vector<std::filesystem::path> results = result_files(job, track_file_names());
        written.insert(written.end(), results.begin(), results.end());
    }
    refuse_to_overwrite(read, written);
}

int run(const Options& options)
{
    const std::vector<Job> jobs =
        collect_jobs(options.inputs, options.output, {".mp4", ".mov", ".mkv", ".webm", ".avi", ".m4v", ".ogv"});
    protect_inputs(options, jobs);
    VideoTracker tracker(options.track);
    Json summary = Json::array();
    int failed = 0;
    int last_code = all_done;
    for (const Job& job : jobs) {
        Json entry;
        entry["input"] = job.input.string();
        entry["output"] = job.output.string();
        try {
            const TrackSummary result = tracker.track(job);
            entry["exit_code"] = static_cast<int>(all_done);
            entry["frames"] = result.num_frames;
            entry["frames_with_face"] = result.num_tracked;
            entry["duration_s"] = result.duration_s;
            entry["median_rms_px"] = result.median_rms_px;
            entry["frames_per_second"] = result.frames_per_second;
            if (!options.json) {
                print_data(printable(job.output.string()));
            }
            print_note(job.input.string() + ": " + std::to_string(result.num_frames) + " frames, face in " +
                       std::to_string(result.num_tracked) + ", " +
                       std::to_string(static_cast<int>(result.frames_per_second + 0.5)) + " frames/s over all");
        } catch (...) {
            const Failure failure = current_failure();
            print_error(failure.what());
            entry["exit_code"] = failure.exit_code();
            entry["error"] = failure.what();
            last_code = failure.exit_code();
            ++failed;
        }
        summary.push_back(entry);
        if (signal_exit_code() != 0) {
            break;
        }
    }
    if (options.json) {
        print_data(summary.dump(2, ' ', false, Json::error_handler_t::replace));
    }
    if (signal_exit_code() != 0) {
        if (last_code != signal_exit_code()) { // else the video that was interrupted has said what became of it
            print_error("interrupted after " + std::to_string(summary.size()) + " of " + std::to_string(jobs.size()) +
                        " inputs; what is written is whole");
        }
        return signal_exit_code();
    }
    return jobs.size() > 1 && failed > 0 ? static_cast<int>(some_failed) : last_code;
}

} // namespace

void add_track_command(CLI::App& program, Action& action)
{
    auto options = std::make_shared<Options>();
    CLI::App* command = add_command(program, "track",
                                    "One person's face over each video: a row per frame, an animated mesh, a report.");
    command->add_option("inputs", options->inputs, "Videos, folders of videos, or quoted patterns.")->required();
    command->add_option("-o,--output", options->output, "Folder for the results; each input gets a folder in it.")
        ->capture_default_str();
    add_finder_options(*command, options->track.finder, false);
    add_model_options(*command, options->track.model);
    command
        ->add_option("--identity-frames", options->track.num_identity_frames,
                     "Well-spread frames from which the identity is fitted.")
        ->check(CLI::Range(1, 500))
        ->capture_default_str();
    command->add_option("--texture-size", options->track.texture_size, "Texels a side of the texture.")
        ->check(CLI::Range(16, 8192))
        ->capture_default_str();
    command->add_flag("--json", options->json, "A summary as JSON on stdout.");
    command->footer(
        "Examples:\n  lineament track interview.mp4\n  lineament track clips/ -o tracked --expressions arkit47");
    command->callback([&action, options] { action = [options] { return run(*options); }; });
}

} // namespace lineament::cli
