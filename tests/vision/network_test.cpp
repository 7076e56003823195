// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "engine.hpp"
#include "network.hpp"

#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "support/matchers.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace lineament::network {
namespace {

const std::string models = LINEAMENT_SOURCE_MODELS;
constexpr const char* files[] = {"face_detection_short_range.tflite", "face_detection_full_range.tflite",
                                 "face_landmark_with_attention.tflite"};

std::string content(const std::string& path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Sha256, AgreesWithTheStandardsExamples)
{
    for (const ShaCode code : {ShaCode::fastest, ShaCode::portable}) {
        EXPECT_EQ(sha256("", code), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
        EXPECT_EQ(sha256("abc", code), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", code),
                  "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    }
}

TEST(Sha256, InstructionsAndPortableCodeAgreeAtEveryLength)
{
    std::string bytes;
    for (int length = 0; length < 300; ++length) {
        EXPECT_EQ(sha256(bytes), sha256(bytes, ShaCode::portable)) << length << " bytes";
        bytes += static_cast<char>(37 * length + 11);
    }
}

TEST(LoadNetwork, RefusesFilesThatAreMissingUnknownOrCut)
{
    const test::TemporaryFolder folder;
    EXPECT_TRUE(test::throws<IoError>([&] { (void)load_network(folder / "none"); }, "none", "models/README.md"));
    const std::string bytes = content(models + "/" + files[0]);
    std::string changed = bytes;
    changed[100'000] = static_cast<char>(changed[100'000] ^ 1);
    std::ofstream(folder / "changed", std::ios::binary) << changed;
    EXPECT_TRUE(test::throws<IoError>([&] { (void)load_network(folder / "changed"); }, "changed", "SHA-256"));
    EXPECT_NO_THROW((void)load_network(folder / "changed", NetworkTrust::any));
}

TEST(Networks, AreThoseOfThePinnedPackages)
{
    // Where scripts/make-detector-models.sh has put the packages.
    const char* const cache = std::getenv("XDG_CACHE_HOME");
    const char* const home = std::getenv("HOME");
    const std::string folder = cache != nullptr && *cache != '\0' ? cache : std::string(home ? home : "") + "/.cache";
    const std::string packages = folder + "/lineament/npm/mediapipe-face_";
    const std::string mesh = packages + "mesh-0.4.1633559619/face_mesh_solution_packed_assets.data";
    if (!std::filesystem::exists(mesh)) {
        GTEST_SKIP() << mesh << " not found (scripts/make-detector-models.sh fetches it)";
    }
    EXPECT_TRUE(content(models + "/" + files[2]) == content(mesh).substr(0, 2495952));
    for (const char* file : {files[0], files[1]}) {
        EXPECT_TRUE(content(models + "/" + file) == content(packages + "detection-0.4.1657300184/" + file)) << file;
    }
}

TEST(ParseNetwork, EveryCutIsAnIoError)
{
    for (const char* name : files) {
        const std::string bytes = content(models + "/" + name);
        ASSERT_FALSE(bytes.empty()) << name;
        for (std::size_t size = 0; size < bytes.size(); size += size < 200 ? 1 : bytes.size() / 50) {
            EXPECT_TRUE(test::throws<IoError>(
                [&] {
                    (void)parse_network({bytes.data(), size}, "cut");
                },
                "cut"))
                << size;
        }
    }
}

TEST(ParseNetwork, DamagedBytesAreReadOrRefusedWithoutHarm)
{
    Random random(5);
    for (const char* name : files) {
        const std::string bytes = content(models + "/" + name);
        int refused = 0;
        for (int trial = 0; trial < 60; ++trial) {
            std::string damaged = bytes;
            for (int k = 0; k < 40; ++k) { // the graph stands behind the constants
                const double place = k % 2 == 0 ? 1.0 - 0.25 * random.uniform() : random.uniform();
                damaged[static_cast<std::size_t>(place * static_cast<double>(bytes.size() - 1))] =
                    static_cast<char>(random.index(256));
            }
            try {
                (void)parse_network(damaged, "damaged");
            } catch (const IoError&) {
                ++refused;
            }
        }
        EXPECT_GT(refused, 0) << name;
    }
}

TEST(Engine, XnnpackAndPlainEigenAgreeOnEveryOutput)
{
    for (const char* name : files) {
        const Network network = load_network(models + "/" + name);
        const std::unique_ptr<Engine> plain = make_plain_engine(network);
        const std::unique_ptr<Engine> fast = make_xnnpack_engine(network);
        if (fast == nullptr) {
            GTEST_SKIP() << "built without XNNPACK";
        }
        for (const std::uint64_t seed : {1u, 2u}) {
            Random random(seed);
            for (std::size_t i = 0; i < plain->input().size(); ++i) {
                plain->input()[i] = fast->input()[i] = static_cast<float>(random.uniform());
            }
            plain->run();
            fast->run();
            for (std::size_t k = 0; k < plain->num_outputs(); ++k) {
                const auto as_vector = [](std::span<const float> values) {
                    return Eigen::VectorXf(
                        Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size())));
                };
                EXPECT_THAT(as_vector(fast->output(k)), test::IsNear(as_vector(plain->output(k)), 1e-3))
                    << name << " output " << k << " seed " << seed;
                EXPECT_GT(as_vector(plain->output(k)).norm(), 1e-3f);
            }
        }
    }
}

} // namespace
} // namespace lineament::network
