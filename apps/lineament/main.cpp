// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"

#include "lineament/core/version.hpp"

#include <CLI/CLI.hpp>

#include <cstdint>
#include <cstdlib>

#ifdef __GLIBC__
#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>
#endif

CLI::App* lineament::cli::add_command(CLI::App& parent, const std::string& name, const std::string& description)
{
    return parent.add_subcommand(name, description);
}

namespace {

/// Has the allocator keep what is freed: each picture of some megabytes would else be given back to the system and
/// asked for again, a fault and a cleared page for every 4 kB of it. The memory comes in pages of 2 MB where the system
/// grants them, a fault for each of those.
void keep_freed_memory()
{
#ifdef __GLIBC__
    constexpr std::size_t reserve = 128 << 20; // addresses, more than a photo takes; memory only where it is written
    mallopt(M_MMAP_THRESHOLD, 32 << 20);       // as large as it may be
    mallopt(M_TRIM_THRESHOLD, 512 << 20);
    mallopt(M_TOP_PAD, reserve);
#ifdef MADV_HUGEPAGE
    void* const grown = std::malloc(1 << 20); // with it the heap grows by the reserve
    const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
    const auto start = (reinterpret_cast<std::uintptr_t>(grown) + page - 1) / page * page;
    const auto end = reinterpret_cast<std::uintptr_t>(sbrk(0));
    if (grown != nullptr && start < end) {
        madvise(reinterpret_cast<void*>(start), end - start, MADV_HUGEPAGE); // a wish: it may fail
    }
    std::free(grown);
#endif
#endif
}

} // namespace

int main(int argc, char** argv)
{
    using namespace lineament::cli;
    keep_freed_memory();
    catch_signals();
    CLI::App program{"Real-time 3D face reconstruction from photos and video.", "lineament"};
    program.set_version_flag("--version", std::string("lineament ") + lineament::version);
    program.require_subcommand(1);
    program.fallthrough();
    program.add_flag_function(
        "-q,--quiet", [](std::int64_t) { be_quiet(); }, "No progress bar and no notes.");
    program.add_flag_function(
        "--strict", [](std::int64_t) { be_strict(); }, "Warnings about inputs become errors (exit code 3).");
    program.footer("Examples:\n"
                   "  lineament fit portrait.jpg               one folder 'portrait' with mesh, texture and report\n"
                   "  lineament fit photos/ -o faces           every picture of a folder\n"
                   "  lineament track interview.mp4            a row per frame, an animated face, a report\n"
                   "  lineament model info                     what the face model holds\n"
                   "  lineament doctor                         what is installed and what is missing\n"
                   "Exit codes: 0 all done; 1 several inputs, some failed; 2 wrong use; 3 bad input; 4 file or device "
                   "failed;\n  5 limit exceeded; 6 no trustworthy answer in the input; 130/143 interrupted.");
    Action action;
    add_fit_command(program, action);
    add_track_command(program, action);
    add_model_command(program, action);
    add_doctor_command(program, action);
    try {
        program.parse(argc, argv);
    } catch (const CLI::Success& request) { // --help, --version
        program.exit(request);
        return std::fflush(stdout) == 0 ? all_done : system_failed;
    } catch (const CLI::ParseError& error) {
        print_error(std::string(error.what()) + " (lineament --help shows how to use it)");
        return wrong_use;
    }
    try {
        return action();
    } catch (...) {
        const Failure failure = current_failure();
        print_error(failure.what());
        return failure.exit_code();
    }
}
