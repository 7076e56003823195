// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the tests of the command-line tool share: running it, and a picture with landmarks for it.
#pragma once

#include "lineament/io/file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/io/model_file.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <cstdlib>
#include <fstream>

#include <sys/wait.h>

namespace lineament::test {

struct Outcome
{
    int exit_code = -1; ///< -1: killed by a signal.
    std::string out;
    std::string error;
};

inline std::string read_all(const std::string& path)
{
    return read_text_file(path);
}

/// Runs the program through the shell inside a folder.
/// @param environment  Assignments before the command, "LINEAMENT_MODEL=x".
inline Outcome run(const TemporaryFolder& folder, const std::string& arguments, const std::string& environment = "")
{
    const std::string command = "cd '" + folder.path().string() + "' && " + environment + " '" LINEAMENT_PROGRAM "' " +
                                arguments + " > stdout.txt 2> stderr.txt";
    const int status = std::system(command.c_str());
    Outcome outcome;
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    outcome.out = read_all(folder / "stdout.txt");
    outcome.error = read_all(folder / "stderr.txt");
    return outcome;
}

/// That no file below the folder has the name of an output that is not complete.
inline void expect_no_temporary_files(const std::filesystem::path& folder)
{
    for (const std::filesystem::directory_entry& entry : std::filesystem::recursive_directory_iterator(folder)) {
        EXPECT_EQ(entry.path().filename().string().rfind(".lineament-", 0), std::string::npos) << entry.path();
    }
}

inline void save_text(const std::string& path, const std::string& text)
{
    std::ofstream(path) << text;
}

inline Camera camera_of_picture()
{
    Camera camera;
    camera.scale_px_per_mm = 1.6;
    camera.principal_point_px = Eigen::Vector2d(320, 240);
    camera.camera_from_model = rotation_from_angles({radians(12), radians(4), radians(-3)});
    return camera;
}

/// A grey picture, and landmarks of the default model's mean in it: <stem>.png and <stem>.json.
inline void save_synthetic_picture(const TemporaryFolder& folder, const std::string& stem, double phi_per_mm = 0.0)
{
    ImageU8 picture(640, 480, 3, 128);
    for (int row = 0; row < picture.height; ++row) {
        for (int column = 0; column < picture.width; ++column) {
            picture.at(column, row, 0) = static_cast<std::uint8_t>(column * 255 / picture.width);
        }
    }
    save_png(folder / (stem + ".png"), picture);
    const MorphableModel model = load_model(default_model_path());
    Random random(11);
    Camera camera = camera_of_picture();
    camera.phi_per_mm = phi_per_mm;
    const LandmarkSet set =
        project_landmarks(model, "ibug68", Eigen::VectorXd::Zero(0), Eigen::VectorXd::Zero(0), camera, 0.3, random);
    save_landmarks(folder / (stem + ".json"), set, picture.width, picture.height);
}

} // namespace lineament::test
