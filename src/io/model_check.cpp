// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/core/checks.hpp"
#include "lineament/io/model_file.hpp"

#include <algorithm>
#include <limits>
#include <set>

namespace lineament {

namespace {

constexpr double weight_tolerance = 1e-4; // sums of three float32 weights, with room for other programs' rounding

/// Collects the first fault only.
class FaultFinder
{
public:
    explicit FaultFinder(const MorphableModel& model) : model_(model), num_vertices_(model.num_vertices()) {}

    std::optional<ModelFault> run()
    {
        check_pca(model_.shape, "shape");
        check_levels();
        if (model_.color) {
            check_pca(*model_.color, "color");
        }
        check_names(model_.expression_sets, "expression", [](const Blendshapes& set) { return set.name; });
        for (const Blendshapes& set : model_.expression_sets) {
            check_expressions(set);
        }
        check_finite(model_.uv_coordinates.data(), model_.uv_coordinates.size(), "uv/coordinates", "uv point", 2);
        check_names(model_.landmark_maps, "landmarks", [](const LandmarkMap& map) { return map.scheme; });
        for (const LandmarkMap& map : model_.landmark_maps) {
            check_landmarks(map);
        }
        check_contour(model_.contour_left, "contour/left");
        check_contour(model_.contour_right, "contour/right");
        check_mirror();
        for (const auto& [region, weights] : model_.masks) {
            check_mask(region, weights);
        }
        return fault_;
    }

private:
    void fail(const std::string& part, const std::string& what)
    {
        if (!fault_) {
            fault_ = ModelFault{part, what};
        }
    }
    bool expect(bool condition, const std::string& part, const std::string& what)
    {
        if (!condition) {
            fail(part, what);
        }
        return condition && !fault_;
    }
    bool expect_size(Eigen::Index size, Eigen::Index expected, const std::string& part, const std::string& of)
    {
        return expect(size == expected, part,
                      "has " + std::to_string(size) + " " + of + "; expected " + std::to_string(expected));
    }

    /// `count` numbers in groups of `group_size` (3: x, y, z of vertices; column after column of `rows` numbers).
    void check_finite(const float* values, Eigen::Index count, const std::string& part, const char* noun,
                      Eigen::Index group_size, Eigen::Index rows = 0)
    {
        for (Eigen::Index i = 0; i < count; ++i) {
            if (!std::isfinite(values[i])) {
                const Eigen::Index within = rows > 0 ? i % rows : i;
                std::string place = rows > 0 ? "mode " + std::to_string(i / rows) + ", " : "";
                place += std::string(noun) + " " + std::to_string(within / group_size);
                if (group_size > 1) {
                    place += std::string(", ") + "xyz"[within % group_size];
                }
                fail(part, place + " is " + to_text(values[i]) + "; expected a finite number");
                return;
            }
        }
    }

    void check_noise(const Eigen::VectorXf& values, const std::string& part)
    {
        for (Eigen::Index i = 0; i < values.size(); ++i) {
            if (!(values[i] > 0)) {
                fail(part, "number " + std::to_string(i) + " is " + to_text(values[i]) +
                               "; expected a number > 0, or infinity for a landmark that is no measurement");
                return;
            }
        }
    }

    void check_positive(const Eigen::VectorXf& values, const std::string& part)
    {
        for (Eigen::Index i = 0; i < values.size(); ++i) {
            if (!(values[i] > 0) || !std::isfinite(values[i])) {
                fail(part,
                     "number " + std::to_string(i) + " is " + to_text(values[i]) + "; expected a finite number > 0");
                return;
            }
        }
    }

    void check_indices(const int* values, Eigen::Index count, Eigen::Index limit, const std::string& part,
                       const std::string& of)
    {
        for (Eigen::Index i = 0; i < count; ++i) {
            if (values[i] < 0 || values[i] >= limit) {
                fail(part, "index " + std::to_string(values[i]) + " at position " + std::to_string(i) +
                               " is out of range; there are " + std::to_string(limit) + " " + of);
                return;
            }
        }
    }

    /// Names that become parts of tensor names: letters, digits, '_', '-', '.'; each once.
    template <typename Items, typename NameOf>
    void check_names(const Items& items, const std::string& part, NameOf name_of)
    {
        std::set<std::string> names;
        for (const auto& item : items) {
            const std::string name = name_of(item);
            const bool is_plain =
                !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](unsigned char c) {
                    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
                           c == '-' || c == '.';
                });
            expect(is_plain, part, "name '" + name + "' must be 1 to 64 of a-z, A-Z, 0-9, '_', '-', '.'");
            expect(names.insert(name).second, part, "name '" + name + "' is used twice");
        }
    }

    void check_label_list(const std::vector<std::string>& labels, const std::string& part)
    {
        std::set<std::string> seen;
        for (const std::string& label : labels) {
            expect(!label.empty(), part, "a name is empty");
            expect(seen.insert(label).second, part, "name '" + label + "' is used twice");
        }
    }

    void check_pca(const PcaModel& pca, const std::string& part)
    {
        if (!expect(pca.mean.size() % 3 == 0 && pca.mean.size() > 0, part + "/mean",
                    "has " + std::to_string(pca.mean.size()) + " numbers; expected three a vertex") ||
            !expect_size(pca.mean.size() / 3, num_vertices_, part + "/mean", "vertices") ||
            !expect_size(pca.basis.rows() / 3, num_vertices_, part + "/basis", "vertices") ||
            !expect_size(pca.basis.rows(), pca.mean.size(), part + "/basis", "rows") ||
            !expect_size(pca.standard_deviations.size(), pca.basis.cols(), part + "/standard_deviations", "numbers")) {
            return;
        }
        check_finite(pca.mean.data(), pca.mean.size(), part + "/mean", "vertex", 3);
        check_finite(pca.basis.data(), pca.basis.size(), part + "/basis", "vertex", 3, pca.basis.rows());
        check_positive(pca.standard_deviations, part + "/standard_deviations");
    }

    void check_levels()
    {
        if (!expect(!model_.levels.empty(), "levels", "there is no level; expected at least one")) {
            return;
        }
        expect_size(model_.levels.back().num_vertices, num_vertices_, "levels", "vertices at the finest level");
        check_label_list(model_.triangle_group_names, "triangle_groups");
        int previous = 0;
        for (std::size_t i = 0; i < model_.levels.size(); ++i) {
            const Level& level = model_.levels[i];
            const std::string part = "level" + std::to_string(i);
            if (!expect(level.num_vertices > previous && level.num_vertices <= num_vertices_, "levels",
                        "level " + std::to_string(i) + " has " + std::to_string(level.num_vertices) +
                            " vertices; expected more than " + std::to_string(previous) + " and at most " +
                            std::to_string(num_vertices_))) {
                return;
            }
            previous = level.num_vertices;
            const Eigen::Index count = level.triangles.cols();
            check_indices(level.triangles.data(), level.triangles.size(), level.num_vertices, part + "/triangles",
                          "vertices");
            if (level.triangle_groups.size() > 0) {
                expect_size(level.triangle_groups.size(), count, part + "/triangle_groups", "triangles");
                check_indices(level.triangle_groups.data(), level.triangle_groups.size(),
                              static_cast<Eigen::Index>(model_.triangle_group_names.size()), part + "/triangle_groups",
                              "group names");
            }
            if (level.uv_triangles.cols() > 0) {
                expect_size(level.uv_triangles.cols(), count, part + "/uv_triangles", "triangles");
                check_indices(level.uv_triangles.data(), level.uv_triangles.size(), model_.uv_coordinates.cols(),
                              part + "/uv_triangles", "uv points");
            }
        }
    }

    void check_expressions(const Blendshapes& set)
    {
        const std::string part = "expression/" + set.name;
        const auto count = static_cast<Eigen::Index>(set.names.size());
        if (expect_size(set.offsets.rows() / 3, num_vertices_, part + "/offsets", "vertices") &&
            expect_size(set.offsets.rows(), 3 * num_vertices_, part + "/offsets", "rows") &&
            expect_size(set.offsets.cols(), count, part + "/offsets", "blendshapes") &&
            expect_size(set.standard_deviations.size(), count, part + "/standard_deviations", "numbers")) {
            check_label_list(set.names, part + "/names");
            check_finite(set.offsets.data(), set.offsets.size(), part + "/offsets", "vertex", 3, set.offsets.rows());
            check_positive(set.standard_deviations, part + "/standard_deviations");
        }
    }

    void check_landmarks(const LandmarkMap& map)
    {
        const std::string part = "landmarks/" + map.scheme;
        const auto count = static_cast<Eigen::Index>(map.names.size());
        if (!expect_size(map.vertices.cols(), count, part + "/vertices", "landmarks") ||
            !expect_size(map.weights.cols(), count, part + "/weights", "landmarks")) {
            return;
        }
        check_label_list(map.names, part + "/names");
        check_indices(map.vertices.data(), map.vertices.size(), coarsest(), part + "/vertices",
                      "vertices at the coarsest level");
        for (Eigen::Index l = 0; l < count; ++l) {
            const Eigen::Vector3d weights = map.weights.col(l).cast<double>();
            if (!(weights.minCoeff() >= 0) || !(std::abs(weights.sum() - 1.0) <= weight_tolerance)) {
                fail(part + "/weights", "landmark '" + map.names[static_cast<std::size_t>(l)] + "' has weights " +
                                            to_text(weights[0]) + ", " + to_text(weights[1]) + ", " +
                                            to_text(weights[2]) + "; expected numbers >= 0 with sum 1");
                return;
            }
        }
        check_names(map.noise_mm, part + "/noise", [](const auto& item) { return item.first; });
        for (const auto& [detector, noise] : map.noise_mm) {
            expect_size(noise.size(), count, part + "/noise/" + detector, "landmarks");
            check_noise(noise, part + "/noise/" + detector);
        }
    }

    void check_contour(const std::vector<int>& contour, const std::string& part)
    {
        check_indices(contour.data(), static_cast<Eigen::Index>(contour.size()), coarsest(), part,
                      "vertices at the coarsest level");
    }

    void check_mirror()
    {
        const Eigen::VectorXi& mirror = model_.mirror;
        if (mirror.size() == 0 || !expect_size(mirror.size(), num_vertices_, "mirror", "vertices")) {
            return;
        }
        check_indices(mirror.data(), mirror.size(), num_vertices_, "mirror", "vertices");
        for (Eigen::Index i = 0; i < mirror.size() && !fault_; ++i) {
            expect(mirror[mirror[i]] == i, "mirror",
                   "vertex " + std::to_string(i) + " has the partner " + std::to_string(mirror[i]) +
                       ", whose partner is " + std::to_string(mirror[mirror[i]]) + "; expected each other");
        }
        for (const Level& level : model_.levels) {
            for (int i = 0; i < level.num_vertices && !fault_; ++i) {
                expect(mirror[i] < level.num_vertices, "mirror",
                       "vertex " + std::to_string(i) + " has the partner " + std::to_string(mirror[i]) +
                           ", which the level of " + std::to_string(level.num_vertices) + " vertices lacks");
            }
        }
    }

    void check_mask(const std::string& region, const Eigen::VectorXf& weights)
    {
        const std::string part = "masks/" + region;
        check_names(std::vector<std::string>{region}, "masks", [](const std::string& name) { return name; });
        expect_size(weights.size(), num_vertices_, part, "vertices");
        for (Eigen::Index i = 0; i < weights.size(); ++i) {
            if (!(weights[i] >= 0 && weights[i] <= 1)) {
                fail(part, "vertex " + std::to_string(i) + " has the weight " + to_text(weights[i]) +
                               "; expected a number in [0, 1]");
                return;
            }
        }
    }

    [[nodiscard]] Eigen::Index coarsest() const
    {
        return model_.levels.empty() ? num_vertices_ : model_.levels.front().num_vertices;
    }

    const MorphableModel& model_;
    Eigen::Index num_vertices_;
    std::optional<ModelFault> fault_ = std::nullopt;
};

void warn_about_pca(const PcaModel& pca, const std::string& part, std::vector<std::string>& warnings)
{
    constexpr float tolerance = 1e-3f; // far above what 16-bit storage does, far below a basis that is scaled
    const Eigen::Index count = pca.num_coefficients();
    if (count == 0) {
        return;
    }
    const Eigen::MatrixXf product = pca.basis.transpose() * pca.basis;
    Eigen::Index row = 0;
    Eigen::Index column = 0;
    const float error = (product - Eigen::MatrixXf::Identity(count, count)).cwiseAbs().maxCoeff(&row, &column);
    if (!(error <= tolerance)) {
        warnings.push_back(part + "/basis is not orthonormal: the product of modes " + std::to_string(row) + " and " +
                           std::to_string(column) + " is " + to_text(product(row, column)) + ", expected " +
                           (row == column ? "1" : "0"));
    }
    for (Eigen::Index i = 1; i < count; ++i) {
        if (pca.standard_deviations[i] > pca.standard_deviations[i - 1]) {
            warnings.push_back(part + "/standard_deviations do not descend: number " + std::to_string(i) +
                               " is larger than the one before");
            break;
        }
    }
}

} // namespace

std::optional<ModelFault> find_model_fault(const MorphableModel& model)
{
    return FaultFinder(model).run();
}

std::vector<std::string> find_model_warnings(const MorphableModel& model)
{
    std::vector<std::string> warnings;
    warn_about_pca(model.shape, "shape", warnings);
    if (model.color) {
        warn_about_pca(*model.color, "color", warnings);
    }
    if (model.uv_coordinates.size() > 0 &&
        !(model.uv_coordinates.minCoeff() >= 0 && model.uv_coordinates.maxCoeff() <= 1)) {
        warnings.push_back("uv/coordinates leave the square [0, 1] x [0, 1]");
    }
    return warnings;
}

} // namespace lineament
