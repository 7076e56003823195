// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "engine.hpp"
#include "network.hpp"
#include "square_window.hpp"

#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "support/matchers.hpp"
#include "support/rendered_person.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace lineament::network {
namespace {

const std::string models = LINEAMENT_SOURCE_MODELS;
constexpr KnownNetwork networks[] = {short_range_network, full_range_network, landmark_network};

std::string path_of(const KnownNetwork& network)
{
    return models + "/" + std::string(network.file);
}

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
    EXPECT_TRUE(test::throws<IoError>([&] { (void)load_network(folder / "none", networks[0].sha256); }, "none",
                                      "models/README.md"));
    const std::string bytes = content(path_of(networks[0]));
    std::string changed = bytes;
    changed[100'000] = static_cast<char>(changed[100'000] ^ 1);
    std::ofstream(folder / "changed", std::ios::binary) << changed;
    EXPECT_TRUE(test::throws<IoError>([&] { (void)load_network(folder / "changed", networks[0].sha256); }, "changed",
                                      "expected the network of SHA-256 3bc182eb", "found"));
    EXPECT_NO_THROW((void)load_network(folder / "changed", ""));
}

TEST(Networks, AreThoseOfThePinnedPackages)
{
    // Where scripts/test.sh and scripts/make-detector-models.sh put the packages.
    const char* const cache = std::getenv("XDG_CACHE_HOME");
    const char* const home = std::getenv("HOME");
    const std::string folder = cache != nullptr && *cache != '\0' ? cache : std::string(home ? home : "") + "/.cache";
    const std::string packages = folder + "/lineament/npm/mediapipe-face_";
    const std::string mesh = packages + "mesh-0.4.1633559619/face_mesh_solution_packed_assets.data";
    if (!std::filesystem::exists(mesh)) {
        GTEST_SKIP() << mesh << " not found (scripts/test.sh fetches it)";
    }
    EXPECT_TRUE(content(path_of(networks[2])) == content(mesh).substr(0, 2495952));
    for (const KnownNetwork& network : {networks[0], networks[1]}) {
        EXPECT_TRUE(content(path_of(network)) ==
                    content(packages + "detection-0.4.1657300184/" + std::string(network.file)))
            << network.file;
    }
}

TEST(ParseNetwork, EveryCutIsAnIoError)
{
    for (const KnownNetwork& known : networks) {
        const std::string bytes = content(path_of(known));
        ASSERT_FALSE(bytes.empty()) << known.file;
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

/// fuzz/make_small_network.py: every operation the reader knows.
std::string small_network()
{
    return content(std::string(LINEAMENT_SOURCE_DIR) + "/tests/vision/data/small.tflite");
}

TEST(ParseNetwork, EveryCutAndEveryWrongByteOfASmallNetworkIsReadOrRefused)
{
    const std::string bytes = small_network();
    EXPECT_EQ(parse_network(bytes, "small").steps.size(), 19u);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
        try { // the writer fills the end with a constant and its padding
            (void)parse_network({bytes.data(), size}, "cut");
            EXPECT_GT(size, bytes.size() - 4) << "cut at " << size;
        } catch (const IoError&) {
        }
    }
    std::size_t refused = 0;
    for (std::size_t place = 0; place < bytes.size(); ++place) {
        for (const int value : {0x00, 0x7f, 0x80, 0xff, bytes[place] + 1}) {
            std::string damaged = bytes;
            damaged[place] = static_cast<char>(value);
            try {
                (void)parse_network(damaged, "damaged");
            } catch (const IoError&) {
                ++refused;
            }
        }
    }
    EXPECT_GT(refused, bytes.size());
}

TEST(Engine, BothEnginesAgreeOnEveryOperation)
{
    const Network network = parse_network(small_network(), "small");
    const std::unique_ptr<Engine> plain = make_plain_engine(network);
    const std::unique_ptr<Engine> fast = make_engine(network);
    Random random(3);
    for (std::size_t i = 0; i < plain->input().size(); ++i) {
        plain->input()[i] = fast->input()[i] = static_cast<float>(random.normal());
    }
    plain->run();
    fast->run();
    for (std::size_t k = 0; k < plain->num_outputs(); ++k) {
        ASSERT_EQ(plain->output(k).size(), fast->output(k).size());
        float largest = 0.0f;
        for (std::size_t i = 0; i < plain->output(k).size(); ++i) {
            EXPECT_NEAR(fast->output(k)[i], plain->output(k)[i], 1e-3f) << "output " << k;
            largest = std::max(largest, std::abs(plain->output(k)[i]));
        }
        EXPECT_GT(largest, 1e-3f) << "output " << k;
    }
}

TEST(ParseNetwork, DamagedBytesAreReadOrRefusedWithoutHarm)
{
    Random random(5);
    for (const KnownNetwork& known : networks) {
        const std::string bytes = content(path_of(known));
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
        EXPECT_GT(refused, 0) << known.file;
    }
}

TEST(Engine, XnnpackAndPlainEigenAgreeOnEveryOutput)
{
    for (const KnownNetwork& known : networks) {
        const Network network = load_network(path_of(known), known.sha256);
        const std::unique_ptr<Engine> plain = make_plain_engine(network);
        const std::unique_ptr<Engine> fast = make_xnnpack_engine(network);
        if (fast == nullptr) {
            GTEST_SKIP() << "built without XNNPACK";
        }
        const float low = known.file == landmark_network.file ? 0.0f : -1.0f;
        for (const std::uint64_t seed : {1u, 2u, 3u}) {
            if (seed == 3) { // a face, as MeshDetector would show it
                const int size = network.tensors[network.input].shape[1];
                const ImageU8 picture = test::RenderedPerson(4).picture(20.0, 300, 300);
                sample_window(picture, window_around(picture), size, Border::black, low, 1.0f, plain->input());
            } else {
                Random random(seed);
                for (float& value : plain->input()) {
                    value = static_cast<float>(random.uniform());
                }
            }
            std::copy(plain->input().begin(), plain->input().end(), fast->input().begin());
            plain->run();
            fast->run();
            for (std::size_t k = 0; k < plain->num_outputs(); ++k) {
                const auto as_vector = [](std::span<const float> values) {
                    return Eigen::VectorXf(
                        Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size())));
                };
                EXPECT_THAT(as_vector(fast->output(k)), test::IsNear(as_vector(plain->output(k)), 1e-3))
                    << known.file << " output " << k << " seed " << seed;
                EXPECT_GT(as_vector(plain->output(k)).norm(), 1e-3f);
            }
        }
    }
}

} // namespace
} // namespace lineament::network
