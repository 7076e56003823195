// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/model_file.hpp"

#include "lineament/io/file.hpp"
#include "lineament/io/safetensors.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_face.hpp"

#include <cstdlib>
#include <cstring>
#include <limits>

namespace lineament {
namespace {

using test::TemporaryFolder;
using test::throws;

using Bytes = std::vector<std::byte>;

Eigen::VectorXf vector_of(std::initializer_list<float> values)
{
    Eigen::VectorXf result(static_cast<Eigen::Index>(values.size()));
    std::copy(values.begin(), values.end(), result.data());
    return result;
}

/// A model with every part of the format, of a few kilobytes.
MorphableModel small_model()
{
    MorphableModel model;
    model.name = "tiny \"quoted\"";
    model.license = "CC0-1.0";
    model.provenance = "made by the tests; caf\xc3\xa9";
    Random random(7);
    const Eigen::Index num_vertices = 6;
    const auto normal = [&](Eigen::Index rows, Eigen::Index columns) {
        Eigen::MatrixXf values(rows, columns);
        for (float& value : values.reshaped()) {
            value = static_cast<float>(random.normal());
        }
        return values;
    };
    model.shape.mean = 50 * normal(3 * num_vertices, 1);
    model.shape.basis = Eigen::MatrixXf::Identity(3 * num_vertices, 3);
    model.shape.standard_deviations = vector_of({3, 2, 1});
    model.color = PcaModel{Eigen::VectorXf::Constant(3 * num_vertices, 0.5f),
                           Eigen::MatrixXf::Constant(3 * num_vertices, 1, 1 / std::sqrt(18.0f)),
                           Eigen::VectorXf::Constant(1, 0.25f)};
    model.expression_sets = {{"ekman6", {"anger", "fear"}, normal(3 * num_vertices, 2), vector_of({0.5f, 0.25f})},
                             {"arkit47", {"jawOpen"}, normal(3 * num_vertices, 1), Eigen::VectorXf::Ones(1)}};
    Level coarse{4};
    coarse.triangles.resize(3, 2);
    coarse.triangles << 0, 1, 1, 3, 2, 2;
    coarse.triangle_groups.resize(2);
    coarse.triangle_groups << 0, 1;
    coarse.uv_triangles = coarse.triangles;
    Level fine = coarse;
    fine.num_vertices = 6;
    fine.triangles(2, 1) = 5;
    model.levels = {coarse, fine};
    model.triangle_group_names = {"skin", "eyes"};
    model.uv_coordinates = 0.25f * Eigen::Matrix2Xf::Ones(2, 4);
    LandmarkMap map;
    map.scheme = "ibug68";
    map.names = {"1", "2"};
    map.vertices.resize(3, 2);
    map.vertices << 0, 1, 1, 1, 2, 1;
    map.weights.resize(3, 2);
    map.weights << 0.5f, 1, 0.25f, 0, 0.25f, 0;
    map.noise_mm["dlib"] = vector_of({1.5f, std::numeric_limits<float>::infinity()});
    model.landmark_maps = {map};
    model.contour_left = {1, 3};
    model.contour_right = {0, 2};
    model.mirror.resize(6);
    model.mirror << 1, 0, 3, 2, 4, 5;
    model.masks["face"] = Eigen::VectorXf::LinSpaced(6, 0, 1);
    return model;
}

/// CRC-32C, bit by bit: the definition.
std::uint32_t slow_crc32c(std::span<const std::byte> bytes)
{
    std::uint32_t crc = 0xffffffff;
    for (const std::byte byte : bytes) {
        crc ^= static_cast<std::uint32_t>(byte);
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc & 1) != 0 ? (crc >> 1) ^ 0x82f63b78 : crc >> 1;
        }
    }
    return ~crc;
}

/// The file with the right checksum entered.
Bytes with_checksum(Bytes file)
{
    const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
    const std::size_t position = text.find("\"crc32c\":\"") + 10;
    std::memset(file.data() + position, '0', 8);
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", slow_crc32c(file));
    std::memcpy(file.data() + position, digits, 8);
    return file;
}

/// A file taken apart, to be put together again with one thing wrong and a right checksum.
struct Parts
{
    std::map<std::string, std::string> metadata;
    std::vector<Tensor> tensors;
    std::map<std::string, Bytes> elements;

    explicit Parts(const MorphableModel& model, StorageType storage = StorageType::float32)
    {
        const Bytes file = format_model(model, {storage, storage, storage});
        const Safetensors parsed = parse_safetensors(file, "parts");
        metadata = parsed.metadata;
        for (const Tensor& tensor : parsed.tensors) {
            tensors.push_back(tensor);
            elements[tensor.name] = Bytes(tensor.elements.begin(), tensor.elements.end());
        }
    }
    Tensor& tensor(const std::string& name)
    {
        return *std::find_if(tensors.begin(), tensors.end(), [&](const Tensor& t) { return t.name == name; });
    }
    template <typename Number>
    void set(const std::string& name, std::size_t index, Number value)
    {
        std::memcpy(elements.at(name).data() + index * sizeof(Number), &value, sizeof value);
    }
    void remove(const std::string& name)
    {
        std::erase_if(tensors, [&](const Tensor& t) { return t.name == name; });
    }
    /// Repeats or cuts elements to make the tensor fit a new shape.
    void reshape(const std::string& name, const std::vector<std::uint64_t>& shape)
    {
        Tensor& t = tensor(name);
        std::size_t count = size_of(t.type);
        for (const std::uint64_t size : shape) {
            count *= size;
        }
        t.shape = shape;
        elements[name].resize(count);
    }
    [[nodiscard]] Bytes file()
    {
        for (Tensor& t : tensors) {
            t.elements = elements.at(t.name);
        }
        return with_checksum(format_safetensors({metadata.begin(), metadata.end()}, tensors));
    }
};

void expect_same(const MorphableModel& a, const MorphableModel& b)
{
    // Two models are the same if their exact files are.
    constexpr SaveModelOptions exact{StorageType::float32, StorageType::float32, StorageType::float32};
    EXPECT_EQ(format_model(a, exact), format_model(b, exact));
    EXPECT_EQ(a.shape.basis, b.shape.basis);
    EXPECT_EQ(a.landmark_maps.front().noise_mm, b.landmark_maps.front().noise_mm);
    EXPECT_EQ(a.masks, b.masks);
}

TEST(Crc32c, EqualsItsDefinitionAndThePublishedCheckValue)
{
    EXPECT_EQ(compute_crc32c(std::as_bytes(std::span(std::string_view("123456789")))), 0xe3069283u);
    Random random(1);
    Bytes bytes(1000);
    for (std::byte& byte : bytes) {
        byte = static_cast<std::byte>(random.bits());
    }
    for (std::size_t size = 0; size < 40; ++size) {
        const auto part = std::span(bytes).first(size);
        EXPECT_EQ(compute_crc32c(part), slow_crc32c(part)) << size;
        EXPECT_EQ(compute_crc32c(std::span(bytes).subspan(size), compute_crc32c(part)), slow_crc32c(bytes));
    }
}

TEST(ModelFile, ExactStorageGivesEveryNumberBack)
{
    const MorphableModel model = small_model();
    const Bytes file = format_model(model, {StorageType::float32, StorageType::float32, StorageType::float32});
    const ModelFile loaded = parse_model_file(file, "m");
    expect_same(loaded.model, model);
    EXPECT_EQ(loaded.model.shape.mean, model.shape.mean);
    EXPECT_EQ(loaded.model.shape.basis, model.shape.basis);
    EXPECT_EQ(loaded.model.expression_sets[1].offsets, model.expression_sets[1].offsets);
    EXPECT_EQ(loaded.model.expression_sets[0].names, model.expression_sets[0].names);
    EXPECT_EQ(loaded.model.levels[1].triangles, model.levels[1].triangles);
    EXPECT_EQ(loaded.model.name, model.name);
    EXPECT_EQ(loaded.model.provenance, model.provenance);
    EXPECT_EQ(loaded.model.mirror, model.mirror);
    EXPECT_EQ(loaded.model.contour_right, model.contour_right);
    EXPECT_EQ(loaded.num_bytes, file.size());
    EXPECT_THAT(loaded.warnings, testing::IsEmpty());
}

TEST(ModelFile, SavingALoadedModelGivesTheSameBytesForEveryStorage)
{
    const TemporaryFolder folder;
    for (const MorphableModel& model : {small_model(), test::make_synthetic_face()}) {
        for (const StorageType shape : {StorageType::float32, StorageType::float16, StorageType::int16}) {
            for (const StorageType expression : {StorageType::float32, StorageType::float16, StorageType::int16}) {
                const SaveModelOptions options{shape, StorageType::int16, expression};
                save_model(folder / "a.safetensors", model, options);
                const ModelFile loaded = load_model_file(folder / "a.safetensors");
                EXPECT_EQ(loaded.storage, options);
                save_model(folder / "b.safetensors", loaded.model, loaded.storage);
                EXPECT_EQ(read_file(folder / "a.safetensors"), read_file(folder / "b.safetensors"));
            }
        }
    }
}

TEST(ModelFile, QuantisationIsStableForEverySizeOfNumber)
{
    MorphableModel model = small_model();
    Random random(3);
    for (int draw = 0; draw < 2000; ++draw) {
        const double size = std::exp(random.uniform(-90, 80));
        for (float& value : model.shape.basis.reshaped()) {
            value = static_cast<float>(size * random.uniform(-1, 1));
        }
        const Bytes first = format_model(model);
        ASSERT_EQ(format_model(parse_model(first, "m")), first) << "size " << size;
    }
}

TEST(ModelFile, QuantisationErrorStaysWithinTheStatedBound)
{
    const MorphableModel model = test::make_synthetic_face();
    const MorphableModel half = parse_model(format_model(model, {.shape_storage = StorageType::float16}), "m");
    const MorphableModel integer = parse_model(format_model(model), "m");
    EXPECT_NE(half.shape.basis, model.shape.basis);
    EXPECT_NE(integer.shape.basis, model.shape.basis);
    for (Eigen::Index mode = 0; mode < model.shape.num_coefficients(); ++mode) {
        const auto column = model.shape.basis.col(mode);
        const float largest = column.cwiseAbs().maxCoeff();
        EXPECT_LE((integer.shape.basis.col(mode) - column).cwiseAbs().maxCoeff(), std::ldexp(largest, -15));
        EXPECT_LE((half.shape.basis.col(mode) - column).cwiseAbs().maxCoeff(), std::ldexp(largest, -11));
    }
}

TEST(ModelFile, EverySingleBitFlipIsDetected)
{
    Bytes file = format_model(small_model());
    ASSERT_LE(file.size(), 20'000u);
    std::size_t num_missed = 0;
    for (std::size_t i = 0; i < 8 * file.size(); ++i) {
        file[i / 8] ^= static_cast<std::byte>(1 << (i % 8));
        try {
            (void)parse_model(file, "m");
            ++num_missed;
            ADD_FAILURE() << "bit " << i;
        } catch (const IoError&) {
        }
        file[i / 8] ^= static_cast<std::byte>(1 << (i % 8));
    }
    EXPECT_EQ(num_missed, 0u);
    EXPECT_NO_THROW((void)parse_model(file, "m"));
}

TEST(ModelFile, EveryTruncationAndEveryExtensionIsDetected)
{
    const Bytes file = format_model(small_model());
    for (std::size_t size = 0; size < file.size(); ++size) {
        const Bytes cut(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(size)); // a block of exact size
        EXPECT_THROW((void)parse_model(cut, "m"), IoError) << size;
    }
    Bytes longer = file;
    longer.push_back(std::byte{0});
    EXPECT_TRUE(throws<IoError>([&] { (void)parse_model(longer, "m"); }, "1 bytes after the last tensor"));
    const Bytes cut(file.begin(), file.end() - 100);
    EXPECT_TRUE(throws<IoError>([&] { (void)parse_model(cut, "m"); }, "ends at 0x", "left; download again?"));
}

TEST(ModelFile, AFlippedNumberIsReportedAsAWrongChecksum)
{
    Bytes file = format_model(small_model());
    file.back() ^= std::byte{1};
    EXPECT_TRUE(throws<IoError>([&] { (void)parse_model(file, "face.safetensors"); },
                                "face.safetensors: file checksum differs (stored ", "computed "));
}

TEST(ModelFile, SaysWhatAWrongFileSeemsToBe)
{
    const auto refused = [](std::string_view content, const auto&... texts) {
        const auto bytes = std::as_bytes(std::span(content));
        return throws<IoError>([&] { (void)parse_model(bytes, "m"); }, texts...);
    };
    using namespace std::string_view_literals;
    EXPECT_TRUE(refused("", "file is empty (0 bytes); a Lineament model is a safetensors file"));
    EXPECT_TRUE(refused("<html><body>404</body>", "HTML"));
    EXPECT_TRUE(refused("version https://git-lfs.github.com/spec/v1\n", "git-LFS pointer", "git lfs pull"));
    EXPECT_TRUE(refused("\x1f\x8b\x08\0\0\0\0\0\0\0"sv, "gzip", "unpack"));
    EXPECT_TRUE(refused("PK\x03\x04\0\0\0\0\0\0"sv, "zip"));
    EXPECT_TRUE(refused("\x80\x04\x95\0\0\0\0\0\0\0"sv, "pickle"));
    EXPECT_TRUE(refused("\x89PNG\r\n\x1a\n\0\0"sv, "PNG"));
    EXPECT_TRUE(refused("\0\0\0\0\0\0\0\x08{      }"sv, "reverse order"));
    EXPECT_TRUE(refused("\x02\0\0\0\0\0\0\0{}"sv, "not a Lineament model"));
}

TEST(ModelFile, RefusesAHeaderThatLies)
{
    const auto refused = [](const std::string& header, std::size_t num_data_bytes, const auto&... texts) {
        std::string file(8, '\0');
        for (std::size_t i = 0; i < 8; ++i) {
            file[i] = static_cast<char>(header.size() >> (8 * i));
        }
        file += header + std::string(num_data_bytes, '\0');
        const auto bytes = std::as_bytes(std::span(file));
        return throws<IoError>([&] { (void)parse_model(bytes, "m"); }, texts...);
    };
    const auto entry = [](const std::string& shape, const std::string& offsets) {
        return R"({"dtype":"F32","shape":)" + shape + R"(,"data_offsets":)" + offsets + "}";
    };
    EXPECT_TRUE(refused(R"({"a":)" + entry("[-1]", "[0,4]") + "}", 4, "'a'", "shape is -1"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[2147483648]", "[0,4]") + "}", 4, "8589934592 bytes", "give 4"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[4294967296,4294967296]", "[0,4]") + "}", 4, "overflows"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[1e400]", "[0,4]") + "}", 4, "a"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[1]", "[4,0]") + "}", 4, "begin <= end"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[2]", "[0,8]") + "}", 4, "needs 8 bytes, 4 left"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[2]", "[0,8]") + R"(,"b":)" + entry("[1]", "[4,8]") + "}", 8,
                        "'b' overlaps 'a' (4 bytes)"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[1]", "[0,4]") + R"(,"b":)" + entry("[1]", "[8,12]") + "}", 12,
                        "'b' leaves a gap after 'a'"));
    EXPECT_TRUE(refused(R"({"a":)" + entry("[1]", "[0,4]") + R"(,"a":)" + entry("[1]", "[4,8]") + "}", 8,
                        "name 'a' is used twice"));
    EXPECT_TRUE(refused(R"({"__metadata__":{"x":"1","x":"2"}})", 0, "key 'x' is used twice"));
    EXPECT_TRUE(refused(R"({"a":{"dtype":"F32","shape":[]}})", 0, "expected dtype, shape and data_offsets"));
    EXPECT_TRUE(refused(R"({"a":{"dtype":"F64","shape":[],"data_offsets":[0,8]}})", 8, "'F64'"));
    EXPECT_TRUE(refused(R"({"a":[[[[1]]]]})", 0, "not allowed here"));
    EXPECT_TRUE(refused("{\"__metadata__\":{\"x\":\"\xff\"}}", 0, "not valid JSON", "UTF-8"));
    EXPECT_TRUE(refused(R"({"a":)", 0, "not valid JSON"));
    std::string many = "{";
    for (int i = 0; i < 100'000; ++i) {
        many += (i > 0 ? ",\"" : "\"") + std::to_string(i) + "\":" + entry("[0]", "[0,0]");
    }
    EXPECT_TRUE(refused(many + "}", 0, "more than 4096 tensors"));
}

TEST(ModelFile, NamesWhatIsWrongInsideAWholeFile)
{
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto refused = [](Parts parts, const auto&... texts) {
        return throws<IoError>([&] { (void)parse_model(parts.file(), "m"); }, texts...);
    };
    const auto with = [](const auto& change) {
        Parts parts(small_model());
        change(parts);
        return parts;
    };
    EXPECT_NO_THROW((void)parse_model(Parts(small_model()).file(), "m"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("shape/mean", 4, nan); }), "shape/mean", "[1, 1] is nan"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("shape/basis", 25, -INFINITY); }), "[1, 2, 1] is -inf"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("shape/standard_deviations", 1, -2.0f); }),
                        "shape/standard_deviations", "number 1 is -2"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("shape/standard_deviations", 0, 0.0f); }), "is 0"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("level0/triangles", 3, 4); }), "level0/triangles",
                        "index 4 at position 3", "there are 4"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("level0/triangles", 3, -1); }), "index -1"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("level1/uv_triangles", 0, 4); }), "level1/uv_triangles", "index 4"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("level1/triangle_groups", 0, 2); }), "index 2", "2 group names"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("levels", 1, 5); }), "levels", "has 5", "expected 6"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("landmarks/ibug68/vertices", 0, 4); }), "coarsest"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("landmarks/ibug68/weights", 0, 0.6f); }), "sum 1"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("landmarks/ibug68/noise/dlib", 0, -1.0f); }), "noise/dlib"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("landmarks/ibug68/noise/dlib", 0, std::nanf("")); }), "noise/dlib"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("contour/left", 0, 5); }), "contour/left", "index 5"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("mirror", 0, 2); }), "mirror", "expected each other"));
    EXPECT_TRUE(refused(with([&](Parts& p) {
                            p.set("mirror", 3, 4);
                            p.set("mirror", 4, 3);
                            p.set("mirror", 2, 2);
                        }),
                        "mirror", "level of 4 vertices lacks"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.set("masks/face", 0, 1.5f); }), "masks/face", "1.5"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.reshape("shape/mean", {9, 2}); }), "[9, 2]", "expected [n, 3]"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.reshape("color/mean", {5, 3}); }), "color/mean", "5", "expected 6"));
    EXPECT_TRUE(refused(with([&](Parts& p) {
                            p.reshape("expression/ekman6/offsets", {2, 5, 3});
                        }),
                        "expression/ekman6/offsets", "has 5 vertices; expected 6"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.tensor("mirror").type = TensorType::float32; }), "mirror", "type"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.remove("shape/basis"); }), "shape/basis", "missing"));
    EXPECT_TRUE(refused(with([&](Parts& p) {
                            p.tensor("masks/face").name = "mask/face";
                            p.elements["mask/face"] = p.elements["masks/face"];
                        }),
                        "mask/face", "unknown meaning"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.metadata["format_version"] = "7"; }), "version '7'", "reads version 1"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.metadata["format"] = "pt"; }), "'pt'"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.metadata["units"] = "m"; }), "units", "'m'"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.metadata.erase("license"); }), "'license' is missing"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.metadata["triangle_groups"] = "[1]"; }), "triangle_groups", "list"));
    EXPECT_TRUE(refused(with([&](Parts& p) { p.metadata["extra"] = ""; }), "extra", "unknown"));
    Parts scaled(small_model(), StorageType::int16);
    scaled.set("shape/basis_scale", 0, 0.0f);
    EXPECT_TRUE(refused(scaled, "shape/basis_scale", "> 0"));
}

TEST(ModelFile, ABasisThatIsNotOrthonormalIsAWarning)
{
    MorphableModel model = small_model();
    model.shape.basis(0, 0) = 2;
    EXPECT_THAT(parse_model_file(format_model(model), "m").warnings,
                testing::ElementsAre(testing::HasSubstr("shape/basis is not orthonormal")));
}

TEST(SaveModel, RefusesAFaultyModelAndKeepsTheOldFile)
{
    const TemporaryFolder folder;
    save_model(folder / "m.safetensors", small_model());
    const Bytes old = read_file(folder / "m.safetensors");
    MorphableModel model = small_model();
    model.shape.mean[3] = std::numeric_limits<float>::infinity();
    EXPECT_TRUE(throws<InvalidArgument>([&] { save_model(folder / "m.safetensors", model); }, "shape/mean",
                                        "vertex 1, x is inf"));
    model = small_model();
    model.masks["a/b"] = model.masks["face"];
    EXPECT_TRUE(throws<InvalidArgument>([&] { save_model(folder / "m.safetensors", model); }, "a/b"));
    model = small_model();
    model.license = "\xff";
    EXPECT_TRUE(throws<InvalidArgument>([&] { save_model(folder / "m.safetensors", model); }, "UTF-8"));
    model = small_model();
    model.shape.basis(0, 0) = 70'000;
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { save_model(folder / "m.safetensors", model, {.shape_storage = StorageType::float16}); }, "float16"));
    EXPECT_EQ(read_file(folder / "m.safetensors"), old);
}

TEST(LoadModel, NamesAMissingFile)
{
    EXPECT_TRUE(throws<IoError>([] { (void)load_model("/nowhere/m.safetensors"); }, "/nowhere/m.safetensors"));
}

TEST(ModelFile, LevelsOfAModelCanBeSavedAlone)
{
    const MorphableModel model = test::make_synthetic_face();
    const MorphableModel coarse = parse_model(format_model(model.at_level(0)), "m");
    EXPECT_EQ(coarse.num_vertices(), model.levels[0].num_vertices);
}

TEST(ModelFile, TheShippedModelIsWrittenAgainToTheSameBytes)
{
    const std::string path = std::string(LINEAMENT_SOURCE_DIR) + "/models/lineament-face-1.safetensors";
    const ModelFile loaded = load_model_file(path);
    EXPECT_THAT(loaded.warnings, testing::IsEmpty());
    EXPECT_EQ(format_model(loaded.model, loaded.storage), read_file(path));
}

TEST(ModelFile, RandomFlipsInTheShippedModelAreDetected)
{
    Bytes file = read_file(std::string(LINEAMENT_SOURCE_DIR) + "/models/lineament-face-1.safetensors");
    Random random(11);
    for (int draw = 0; draw < 200; ++draw) {
        const auto bit = static_cast<std::size_t>(random.uniform() * 8.0 * static_cast<double>(file.size()));
        const auto mask = static_cast<std::byte>(1 << (bit % 8));
        file[bit / 8] ^= mask;
        EXPECT_THROW((void)parse_model(file, "m"), IoError) << "bit " << bit;
        file[bit / 8] ^= mask;
    }
    EXPECT_NO_THROW((void)parse_model(file, "m"));
}

TEST(DefaultModelPath, TheEnvironmentVariableComesFirst)
{
    const TemporaryFolder folder;
    const char* const old = std::getenv("LINEAMENT_MODEL");
    const std::string saved = old == nullptr ? "" : old;
    write_file(folder / "m", "x");
    setenv("LINEAMENT_MODEL", (folder / "m").c_str(), 1);
    EXPECT_EQ(default_model_path(), folder / "m");
    setenv("LINEAMENT_MODEL", (folder / "none").c_str(), 1);
    EXPECT_TRUE(throws<IoError>([] { (void)default_model_path(); }, "LINEAMENT_MODEL", "none"));
    unsetenv("LINEAMENT_MODEL");
    try {
        EXPECT_THAT(default_model_path().string(), testing::HasSubstr("lineament-face-1.safetensors"));
    } catch (const IoError& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr("LINEAMENT_MODEL"));
        EXPECT_THAT(error.what(), testing::HasSubstr("models"));
    }
    if (!saved.empty()) {
        setenv("LINEAMENT_MODEL", saved.c_str(), 1);
    }
}

} // namespace
} // namespace lineament
