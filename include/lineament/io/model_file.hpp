// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/model/morphable_model.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lineament {

/// How the entries of a basis are stored.
enum class StorageType
{
    float32, ///< 4 bytes, exact.
    float16, ///< 2 bytes, relative error <= 2^-11.
    int16,   ///< 2 bytes times one power of two a mode; error <= 2^-15 of the mode's largest entry.
};

/// How to store a model. Means, standard deviations and everything else are float32 or int32.
struct SaveModelOptions
{
    StorageType shape_storage = StorageType::int16;      ///< Of `shape/basis`.
    StorageType color_storage = StorageType::int16;      ///< Of `color/basis`.
    StorageType expression_storage = StorageType::int16; ///< Of every `expression/<set>/offsets`.

    bool operator==(const SaveModelOptions&) const = default;
};

/// A model with what is known about its file.
struct ModelFile
{
    MorphableModel model = {};
    SaveModelOptions storage = {};          ///< How the file stores it; saving with these gives the same bytes.
    std::vector<std::string> warnings = {}; ///< Sentences: what is unusual but allowed (find_model_warnings).
    std::string crc32c = {};                ///< Checksum of the file, 8 hexadecimal digits.
    std::uint64_t num_bytes = 0;            ///< Of the file.
};

/// The model in a file, layout as in docs/formats.md, section "Model file".
///
/// save_model(path, load_model(path), storage) writes the same bytes again.
/// @throws IoError naming the failed check and its place; nothing damaged is accepted: the checksum covers every byte.
/// @par Cost  About three times the file's size of memory at most; counts are checked before they are used.
[[nodiscard]] MorphableModel load_model(const std::filesystem::path& path);

/// As load_model, with the storage types, warnings and checksum.
[[nodiscard]] ModelFile load_model_file(const std::filesystem::path& path);

/// The model in a file's bytes; `name` stands for the path in messages.
[[nodiscard]] MorphableModel parse_model(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] ModelFile parse_model_file(std::span<const std::byte> bytes, const std::string& name);

/// Writes the model, replacing a file of that name only when all is written.
/// @throws InvalidArgument if the model has a fault (find_model_fault), before anything is written.
/// @throws IoError if writing fails.
void save_model(const std::filesystem::path& path, const MorphableModel& model, const SaveModelOptions& options = {});

/// The bytes of the model's file. The same model and options give the same bytes on every machine.
/// @throws InvalidArgument as save_model.
[[nodiscard]] std::vector<std::byte> format_model(const MorphableModel& model, const SaveModelOptions& options = {});

/// What makes a model unusable.
struct ModelFault
{
    std::string part = {}; ///< Name of the tensor in the file, or of the text.
    std::string what = {}; ///< "mode 12, vertex 884, y is nan; expected a finite number".
};

/// The first fault: sizes that disagree, indices out of range, numbers that are not finite, standard deviations that
/// are not positive, weights that do not sum to 1, a mirror map that is not an involution of every level, names that
/// are empty or used twice. Empty if there is none; every model that is read or written has none.
[[nodiscard]] std::optional<ModelFault> find_model_fault(const MorphableModel& model);

/// What is unusual but usable, as sentences: a basis that is not orthonormal at the full level, standard deviations
/// that do not descend, uv coordinates outside [0, 1].
[[nodiscard]] std::vector<std::string> find_model_warnings(const MorphableModel& model);

/// Where the default model lies: the file named by the environment variable LINEAMENT_MODEL, else
/// models/lineament-face-1.safetensors of the source tree this library was built from, else the installed one.
/// @throws IoError (system) naming all the places looked at, if there is none.
[[nodiscard]] std::filesystem::path default_model_path();

} // namespace lineament
