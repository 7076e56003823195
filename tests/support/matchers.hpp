// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace lineament::test {

/// Largest absolute difference; NaN if any entry is, so that a comparison `<= tolerance` fails.
template <typename A, typename B>
[[nodiscard]] double max_difference(const A& a_expression, const B& b_expression)
{
    const auto& a = a_expression.eval();
    const auto& b = b_expression.eval();
    if (a.rows() != b.rows() || a.cols() != b.cols()) {
        return std::numeric_limits<double>::infinity();
    }
    double largest = 0.0;
    for (Eigen::Index j = 0; j < a.cols(); ++j) {
        for (Eigen::Index i = 0; i < a.rows(); ++i) {
            const double difference = std::abs(static_cast<double>(a(i, j)) - static_cast<double>(b(i, j)));
            if (!(difference <= largest)) {
                largest = difference;
            }
        }
    }
    return largest;
}

/// Matches a matrix of the same size with every entry within the tolerance; NaN never matches.
MATCHER_P2(IsNear, expected, tolerance, "")
{
    const double difference = max_difference(arg, expected);
    *result_listener << "largest difference " << difference << ", allowed " << tolerance;
    return difference <= tolerance;
}

/// Matches an exception whose message contains every given text: EXPECT_THAT(f, ThrowsError<IoError>("a", "b")).
template <typename Exception, typename Function, typename... Texts>
[[nodiscard]] ::testing::AssertionResult throws(Function&& function, const Texts&... texts)
{
    try {
        function();
    } catch (const Exception& error) {
        const std::string message = error.what();
        std::string missing;
        ((message.find(texts) == std::string::npos ? missing += std::string(" [") + texts + "]" : missing), ...);
        if (!missing.empty()) {
            return ::testing::AssertionFailure() << "message \"" << message << "\" lacks" << missing;
        }
        return ::testing::AssertionSuccess();
    } catch (const std::exception& error) {
        return ::testing::AssertionFailure() << "another exception: " << error.what();
    }
    return ::testing::AssertionFailure() << "no exception";
}

/// A new empty folder, removed with everything in it at the end of the scope.
class TemporaryFolder
{
public:
    TemporaryFolder();
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }

private:
    std::filesystem::path path_;
};

/// The folder of real test data ($LINEAMENT_DATA, or ../shared/data beside the project), or an empty path.
[[nodiscard]] std::filesystem::path real_data_folder();

} // namespace lineament::test

/// Ends the test as skipped, naming what is missing, unless the real data hold `relative_path`.
#define LINEAMENT_REQUIRE_REAL_DATA(relative_path)                                                                     \
    if (::lineament::test::real_data_folder().empty() ||                                                               \
        !std::filesystem::exists(::lineament::test::real_data_folder() / (relative_path))) {                           \
        GTEST_SKIP() << "real test data not found: " << (relative_path) << " (set LINEAMENT_DATA)";                    \
    }
