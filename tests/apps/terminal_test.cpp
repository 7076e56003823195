// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "apps/terminal.hpp"

namespace lineament {
namespace {

using test::Outcome;
using test::run;
using test::run_at_terminal;
using test::save_synthetic_picture;

TEST(Terminal, NoColorIsHonoured)
{
    const test::TemporaryFolder folder;
    const std::string arguments = "fit missing.png --quiet";
    const Outcome plain = run_at_terminal(folder, arguments, {}, "NO_COLOR=1");
    EXPECT_EQ(plain.exit_code, 4);
    EXPECT_EQ(plain.error.rfind("lineament: error: ", 0), 0U) << plain.error;
    EXPECT_EQ(plain.error.find('\x1b'), std::string::npos) << plain.error;
    const Outcome coloured = run_at_terminal(folder, arguments);
    EXPECT_NE(coloured.error.find("\x1b[31merror:\x1b[0m"), std::string::npos) << coloured.error;
    EXPECT_EQ(run(folder, arguments).error.find('\x1b'), std::string::npos) << "no terminal, no colour";
}

TEST(Terminal, ProgressIsShownAtATerminalOnlyAndNotToTheQuiet)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const std::string arguments = "fit face.png --landmarks face.json --no-report --texture-size 16 -o out";
    const Outcome shown = run_at_terminal(folder, arguments);
    EXPECT_EQ(shown.exit_code, 0) << shown.error;
    EXPECT_NE(shown.error.find("fit [............................] 0/1 face.png"), std::string::npos) << shown.error;
    const std::string erase_line = "\r\x1b[K";
    ASSERT_GE(shown.error.size(), erase_line.size());
    EXPECT_EQ(shown.error.substr(shown.error.size() - erase_line.size()), erase_line) << "the bar is taken away";
    for (const Outcome& silent : {run_at_terminal(folder, arguments + " --quiet"), run(folder, arguments)}) {
        EXPECT_EQ(silent.exit_code, 0);
        EXPECT_EQ(silent.out, "out/face\n");
        EXPECT_EQ(silent.error, "");
    }
}

} // namespace
} // namespace lineament
