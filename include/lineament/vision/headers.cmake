# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
set(headers
    dlib_detector.hpp
    dlib_outline.hpp
    face_box.hpp
    mesh_detector.hpp
    mesh_yaw.hpp
    short_runs.hpp
    video_reader.hpp
    video_writer.hpp
    video.hpp)
