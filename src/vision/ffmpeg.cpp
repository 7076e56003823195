// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "ffmpeg.hpp"

#include "lineament/core/checks.hpp"

#include <new>

#include <dlfcn.h>

namespace lineament::ffmpeg {

#define LINEAMENT_DEFINE(function) decltype(&::function) function = nullptr
LINEAMENT_FFMPEG_FUNCTIONS(LINEAMENT_DEFINE)
#undef LINEAMENT_DEFINE

namespace {

[[noreturn]] void fail(const char* library)
{
    const char* const reason = dlerror();
    throw IoError(IoErrorKind::system, library, "",
                  "videos need this library of FFmpeg, which cannot be used: " +
                      std::string(reason == nullptr ? "no reason given" : reason));
}

/// Stays loaded until the process ends.
void* open_library(const char* file_name)
{
    void* const library = dlopen(file_name, RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
        fail(file_name);
    }
    return library;
}

template <typename Function>
void find(Function& function, const char* name, void* avformat, void* swscale)
{
    void* symbol = dlsym(avformat, name); // looks through the libraries that avformat needs as well
    if (symbol == nullptr) {
        symbol = dlsym(swscale, name);
    }
    if (symbol == nullptr) {
        fail(name);
    }
    function = reinterpret_cast<Function>(symbol);
}

bool load_once()
{
    // Of the major version of the headers, with which the layout of FFmpeg's structs changes.
    void* const avformat = open_library("libavformat.so." AV_STRINGIFY(LIBAVFORMAT_VERSION_MAJOR));
    void* const swscale = open_library("libswscale.so." AV_STRINGIFY(LIBSWSCALE_VERSION_MAJOR));
#define LINEAMENT_FIND(function) find(function, #function, avformat, swscale)
    LINEAMENT_FFMPEG_FUNCTIONS(LINEAMENT_FIND)
#undef LINEAMENT_FIND
    av_log_set_level(AV_LOG_QUIET);
    return true;
}

} // namespace

void load()
{
    static const bool is_loaded = load_once(); // tried again by the next call if it throws
    static_cast<void>(is_loaded);
}

std::string error_text(int error)
{
    char buffer[AV_ERROR_MAX_STRING_SIZE] = {};
    av_strerror(error, buffer, sizeof buffer);
    return buffer;
}

Frame make_frame(int width, int height, AVPixelFormat format)
{
    Frame frame(av_frame_alloc());
    if (!frame) {
        throw std::bad_alloc();
    }
    frame->width = width;
    frame->height = height;
    frame->format = format;
    if (av_frame_get_buffer(frame.get(), 0) < 0) {
        throw std::bad_alloc();
    }
    return frame;
}

} // namespace lineament::ffmpeg
