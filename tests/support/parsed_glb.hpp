// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cstdint>
#include <cstring>
#include <string>

namespace lineament::test {

/// A GLB file taken apart by a reading of the specification that is the tests' own.
class ParsedGlb
{
public:
    explicit ParsedGlb(const std::string& bytes)
    {
        EXPECT_EQ(bytes.substr(0, 4), "glTF");
        EXPECT_EQ(u32(bytes, 4), 2u);
        EXPECT_EQ(u32(bytes, 8), bytes.size());
        const std::size_t json_size = u32(bytes, 12);
        EXPECT_EQ(bytes.substr(16, 4), "JSON");
        EXPECT_EQ(json_size % 4, 0u);
        gltf = nlohmann::json::parse(bytes.substr(20, json_size));
        const std::size_t chunk = 20 + json_size;
        EXPECT_EQ(bytes.substr(chunk + 4, 4), std::string("BIN\0", 4));
        binary = bytes.substr(chunk + 8);
        EXPECT_EQ(u32(bytes, chunk), binary.size());
        EXPECT_EQ(gltf["buffers"][0]["byteLength"], binary.size());
        EXPECT_EQ(binary.size() % 4, 0u);
    }

    /// The values of an accessor, a column an element.
    Eigen::MatrixXd accessor(const nlohmann::json& index) const
    {
        const nlohmann::json& a = gltf["accessors"].at(index.get<std::size_t>());
        const std::string type = a["type"];
        const int rows = type == "SCALAR" ? 1 : type.back() - '0';
        Eigen::MatrixXd values = Eigen::MatrixXd::Zero(rows, a["count"].get<int>());
        if (a.contains("bufferView")) {
            values = view(a["bufferView"], a["componentType"], rows, a["count"]);
        }
        if (a.contains("sparse")) {
            const nlohmann::json& sparse = a["sparse"];
            const Eigen::MatrixXd at =
                view(sparse["indices"]["bufferView"], sparse["indices"]["componentType"], 1, sparse["count"]);
            const Eigen::MatrixXd changed = view(sparse["values"]["bufferView"], 5126, rows, sparse["count"]);
            for (Eigen::Index i = 0; i < at.cols(); ++i) {
                values.col(static_cast<Eigen::Index>(at(0, i))) = changed.col(i);
            }
        }
        if (a.contains("min")) {
            for (int row = 0; row < rows; ++row) {
                EXPECT_EQ(a["min"][row].get<float>(), static_cast<float>(values.row(row).minCoeff()));
                EXPECT_EQ(a["max"][row].get<float>(), static_cast<float>(values.row(row).maxCoeff()));
            }
        }
        return values;
    }

    std::string view_bytes(const nlohmann::json& index) const
    {
        const nlohmann::json& v = gltf["bufferViews"].at(index.get<std::size_t>());
        EXPECT_EQ(v["byteOffset"].get<std::size_t>() % 4, 0u);
        EXPECT_LE(v["byteOffset"].get<std::size_t>() + v["byteLength"].get<std::size_t>(), binary.size());
        return binary.substr(v["byteOffset"], v["byteLength"]);
    }

    nlohmann::json gltf = {};
    std::string binary = {};

private:
    static std::uint32_t u32(const std::string& bytes, std::size_t at)
    {
        std::uint32_t value = 0;
        std::memcpy(&value, bytes.data() + at, 4); // the machines that run this are little-endian
        return value;
    }

    Eigen::MatrixXd view(const nlohmann::json& index, int component, int rows, int columns) const
    {
        const std::string bytes = view_bytes(index);
        const std::size_t size = component == 5123 ? 2 : 4;
        EXPECT_EQ(bytes.size(), size * static_cast<std::size_t>(rows * columns));
        Eigen::MatrixXd values(rows, columns);
        for (int i = 0; i < rows * columns; ++i) {
            const char* at = bytes.data() + size * static_cast<std::size_t>(i);
            std::uint16_t u16 = 0;
            float f32 = 0;
            std::memcpy(&u16, at, 2);
            std::memcpy(&f32, at, size == 4 ? 4 : 0);
            const double whole = size == 2 ? u16 : static_cast<double>(u32(bytes, 4 * static_cast<std::size_t>(i)));
            values(i % rows, i / rows) = component == 5126 ? static_cast<double>(f32) : whole;
        }
        return values;
    }
};

} // namespace lineament::test
