// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "apps/run_program.hpp"

#include <nlohmann/json.hpp>

#include <map>

namespace lineament {
namespace {

using test::Outcome;
using test::run;

/// Name -> state of what `doctor --json` found.
std::map<std::string, std::string> states(const Outcome& outcome)
{
    const nlohmann::json report = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(report["findings"].size(), 4U);
    std::map<std::string, std::string> found;
    for (const nlohmann::json& finding : report["findings"]) {
        EXPECT_NE(finding["detail"], "") << finding;
        found[finding["name"]] = finding["state"];
    }
    return found;
}

TEST(Doctor, FindsWhatTheseTestsRunWith)
{
    const test::TemporaryFolder folder;
    const Outcome outcome = run(folder, "doctor --json");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
    std::map<std::string, std::string> found = states(outcome);
    EXPECT_EQ(found["face model"], "ok");
    EXPECT_EQ(found["face detector"], "ok");
    EXPECT_EQ(found["video output"], "ok");
    const Outcome text = run(folder, "doctor");
    EXPECT_EQ(text.exit_code, 0);
    for (const auto& [name, state] : found) {
        const std::string line = "\n" + state + std::string(9 - state.size(), ' ') + name + " ";
        EXPECT_NE(text.out.find(line), std::string::npos) << line << text.out;
    }
}

TEST(Doctor, StatesTheLicenceOfEveryModel)
{
    const test::TemporaryFolder folder;
    const nlohmann::json report = nlohmann::json::parse(run(folder, "doctor --json").out);
    const std::map<std::string, std::string> licences = {
        {"face model", "CC0"}, {"face detector", "Apache-2.0"}, {"dlib detector", "excludes commercial use"}};
    int num_found = 0;
    for (const nlohmann::json& finding : report["findings"]) {
        const auto licence = licences.find(finding["name"].get<std::string>());
        if (licence != licences.end() && finding["state"] == "ok") {
            ++num_found;
            EXPECT_NE(finding["detail"].get<std::string>().find(licence->second), std::string::npos) << finding;
        }
    }
    EXPECT_GE(num_found, 2); // dlib's model may be absent
}

TEST(Doctor, NamesWhatIsMissing)
{
    const test::TemporaryFolder folder;
    struct Case
    {
        std::string environment;
        std::string name;
        std::string state;
        int exit_code;
    };
    for (const Case& c : {Case{"LINEAMENT_MODEL=/nowhere", "face model", "missing", 4},
                          Case{"LINEAMENT_NETWORKS=/nowhere", "face detector", "missing", 4},
                          Case{"LINEAMENT_LANDMARK_MODEL=/nowhere", "dlib detector", "absent", 0}}) {
        const Outcome outcome = run(folder, "doctor --json", c.environment);
        EXPECT_EQ(outcome.exit_code, c.exit_code) << c.environment;
        std::map<std::string, std::string> found = states(outcome);
        EXPECT_EQ(found[c.name], c.state) << c.environment;
        for (const char* other : {"face model", "face detector", "video output"}) {
            EXPECT_TRUE(other == c.name || found[other] == "ok") << c.environment << ": " << other;
        }
        EXPECT_NE(outcome.out.find("/nowhere"), std::string::npos) << outcome.out;
    }
}

} // namespace
} // namespace lineament
