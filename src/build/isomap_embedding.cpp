// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Tenenbaum, de Silva and Langford, A Global Geometric Framework for Nonlinear Dimensionality Reduction,
// Science 2000; de Silva and Tenenbaum, Sparse Multidimensional Scaling Using Landmark Points, 2004.
// Departure: the stress is lowered from a fold-free start behind a barrier, because plain scaling folds at ears and
// lips.
#include "lineament/build/isomap_embedding.hpp"

#include "disc_layout.hpp"
#include "geodesics.hpp"
#include "lineament/core/checks.hpp"
#include "mesh_topology.hpp"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <numbers>
#include <set>
#include <string>

namespace lineament {

namespace {

constexpr const char* function_name = "compute_isomap_embedding";
constexpr double uv_margin = 1.0 / 64.0;

/// The surface with its holes closed; the first `num_real` vertices are the mesh's.
struct Disc
{
    Eigen::Matrix3Xd vertices = {};
    Eigen::Matrix3Xi triangles = {};
    Eigen::VectorXi mirror = {}; ///< Identity if there is no symmetry.
    std::vector<int> border = {};
    Eigen::Index num_real = 0;
    bool is_symmetric = false;
};

double loop_length(const Eigen::Matrix3Xd& vertices, const std::vector<int>& loop)
{
    double length = 0.0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
        length += (vertices.col(loop[(i + 1) % loop.size()]) - vertices.col(loop[i])).norm();
    }
    return length;
}

/// Each vertex averaged with its mirrored partner, about the plane x = mean of the partners' middles.
void make_symmetric(Eigen::Matrix3Xd& vertices, const Eigen::VectorXi& mirror)
{
    vertices.row(0).array() -= vertices.row(0).mean();
    const Eigen::Matrix3Xd given = vertices;
    for (int v = 0; v < vertices.cols(); ++v) {
        const Eigen::Vector3d partner = given.col(mirror(v));
        vertices(0, v) = 0.5 * (given(0, v) - partner.x());
        vertices(1, v) = 0.5 * (given(1, v) + partner.y());
        vertices(2, v) = 0.5 * (given(2, v) + partner.z());
    }
}

void close_holes(Disc& disc, std::vector<std::vector<int>> loops)
{
    const auto outer = std::ranges::max_element(
        loops, {}, [&](const std::vector<int>& loop) { return loop_length(disc.vertices, loop); });
    disc.border = *outer;
    loops.erase(outer);
    Eigen::Index num_vertices = disc.vertices.cols();
    Eigen::Index num_triangles = disc.triangles.cols();
    std::size_t num_added = 0;
    for (const std::vector<int>& loop : loops) {
        num_added += loop.size();
    }
    disc.vertices.conservativeResize(3, num_vertices + std::ssize(loops));
    disc.mirror.conservativeResize(num_vertices + std::ssize(loops));
    disc.triangles.conservativeResize(3, num_triangles + static_cast<Eigen::Index>(num_added));
    for (const std::vector<int>& loop : loops) {
        const int center = static_cast<int>(num_vertices++);
        disc.vertices.col(center).setZero();
        for (std::size_t i = 0; i < loop.size(); ++i) {
            disc.vertices.col(center) += disc.vertices.col(loop[i]) / static_cast<double>(loop.size());
            disc.triangles.col(num_triangles++) << loop[(i + 1) % loop.size()], loop[i], center;
        }
        // The partner of a hole's centre is the centre of the hole that holds the partner of its first vertex.
        const int partner = disc.mirror(loop.front());
        const auto other = std::ranges::find_if(
            loops, [&](const std::vector<int>& candidate) { return std::ranges::count(candidate, partner) > 0; });
        disc.mirror(center) = static_cast<int>(disc.num_real + (other - loops.begin()));
    }
}

void require_disc(const Disc& disc)
{
    std::set<std::pair<int, int>> edges;
    std::vector<int> root(static_cast<std::size_t>(disc.vertices.cols()));
    for (int v = 0; v < std::ssize(root); ++v) {
        root[v] = v;
    }
    const auto find_root = [&](int v) {
        while (root[v] != v) {
            v = root[v] = root[root[v]];
        }
        return v;
    };
    for (Eigen::Index t = 0; t < disc.triangles.cols(); ++t) {
        for (int corner = 0; corner < 3; ++corner) {
            const int a = disc.triangles(corner, t);
            const int b = disc.triangles((corner + 1) % 3, t);
            edges.insert(std::minmax(a, b));
            root[find_root(a)] = find_root(b);
        }
    }
    for (int v = 0; v < std::ssize(root); ++v) {
        require(find_root(v) == find_root(0), function_name, "triangles", "one connected surface",
                "no path from vertex 0 to vertex " + std::to_string(v));
    }
    const auto characteristic = disc.vertices.cols() - std::ssize(edges) + disc.triangles.cols();
    require(characteristic == 1, function_name, "triangles", "a disc with holes (Euler characteristic 1 once closed)",
            std::to_string(characteristic) + ", a surface with handles");
}

Disc make_disc(const Mesh& mesh, const Eigen::VectorXi& mirror)
{
    Disc disc = {.vertices = mesh.vertices.cast<double>(),
                 .triangles = mesh.triangles,
                 .mirror = mirror,
                 .num_real = mesh.num_vertices(),
                 .is_symmetric = mirror.size() != 0};
    if (disc.is_symmetric) {
        make_symmetric(disc.vertices, mirror);
    } else {
        disc.mirror = Eigen::VectorXi::LinSpaced(disc.num_real, 0, static_cast<int>(disc.num_real) - 1);
    }
    for (Eigen::Index t = 0; t < disc.triangles.cols(); ++t) {
        const Eigen::Vector3d a = disc.vertices.col(disc.triangles(0, t));
        const Eigen::Vector3d b = disc.vertices.col(disc.triangles(1, t)) - a;
        const Eigen::Vector3d c = disc.vertices.col(disc.triangles(2, t)) - a;
        require(b.cross(c).norm() > 1e-9 * (b.squaredNorm() + c.squaredNorm()), function_name, "vertices",
                "triangles of positive area", "triangle " + std::to_string(t) + " without");
    }
    std::vector<std::vector<int>> loops = detail::border_loops(disc.triangles);
    require(!loops.empty(), function_name, "triangles", "a surface with a border", "a closed one");
    close_holes(disc, std::move(loops));
    require_disc(disc);
    return disc;
}

/// Angles on the circle by arc length, the top of the border upwards. With symmetry the top is where the border crosses
/// the symmetry plane, so that partners get mirrored angles.
Eigen::VectorXd border_angles(const Disc& disc)
{
    const auto n = disc.border.size();
    Eigen::VectorXd arc(static_cast<Eigen::Index>(n));
    double length = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        arc(static_cast<Eigen::Index>(i)) = length;
        length += (disc.vertices.col(disc.border[(i + 1) % n]) - disc.vertices.col(disc.border[i])).norm();
    }
    double top_arc = 0.0;
    double top_y = -std::numeric_limits<double>::infinity();
    int num_crossings = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const int v = disc.border[i];
        const int next = disc.border[(i + 1) % n];
        const bool is_on_plane = disc.mirror(v) == v;
        const bool crosses_plane = disc.is_symmetric && disc.mirror(v) == next;
        if (!is_on_plane && !crosses_plane) {
            continue;
        }
        ++num_crossings;
        const double y = disc.vertices(1, v);
        if (y > top_y) {
            top_y = y;
            const double half_edge = 0.5 * (disc.vertices.col(next) - disc.vertices.col(v)).norm();
            top_arc = arc(static_cast<Eigen::Index>(i)) + (crosses_plane ? half_edge : 0.0);
        }
    }
    if (disc.is_symmetric) {
        require(num_crossings == 2, function_name, "mirror", "an outer border that crosses the symmetry plane twice",
                std::to_string(num_crossings) + " crossings");
    }
    return (arc.array() - top_arc) / length * 2.0 * std::numbers::pi + std::numbers::pi / 2.0;
}

/// The nearest symmetric layout (or step): partners get mirrored coordinates.
void make_layout_symmetric(Eigen::Matrix2Xd& layout, const Disc& disc)
{
    if (!disc.is_symmetric) {
        return;
    }
    for (int v = 0; v < layout.cols(); ++v) {
        const int partner = disc.mirror(v);
        if (v <= partner) {
            const double x = 0.5 * (layout(0, v) - layout(0, partner));
            const double y = 0.5 * (layout(1, v) + layout(1, partner));
            layout.col(v) << x, y;
            layout.col(partner) << -x, y;
        }
    }
}

/// Distances along the surface from sources spread over it (farthest point first), partners together.
struct SourceDistances
{
    std::vector<int> sources = {};
    Eigen::MatrixXd distances = {}; ///< num_real x sources, mm.
};

SourceDistances measure_distances(const Disc& disc, int num_sources)
{
    const detail::Geodesics geodesics(disc.vertices, disc.triangles);
    SourceDistances result;
    std::vector<Eigen::VectorXd> columns;
    Eigen::VectorXd nearest = Eigen::VectorXd::Constant(disc.num_real, std::numeric_limits<double>::infinity());
    Eigen::Index next = 0;
    while (std::ssize(columns) < std::min<Eigen::Index>(num_sources, disc.num_real)) {
        const auto add = [&](int source, const Eigen::VectorXd& from_source) {
            result.sources.push_back(source);
            columns.push_back(from_source);
            nearest = nearest.cwiseMin(from_source);
        };
        const Eigen::VectorXd from_next = geodesics.distances_from(static_cast<int>(next)).head(disc.num_real);
        add(static_cast<int>(next), from_next);
        if (const int partner = disc.mirror(next); partner != next) {
            Eigen::VectorXd mirrored(disc.num_real);
            for (Eigen::Index v = 0; v < disc.num_real; ++v) {
                mirrored(v) = from_next(disc.mirror(v));
            }
            add(partner, mirrored);
        }
        nearest.maxCoeff(&next);
    }
    result.distances.resize(disc.num_real, std::ssize(columns));
    for (std::size_t i = 0; i < columns.size(); ++i) {
        result.distances.col(static_cast<Eigen::Index>(i)) = columns[i];
    }
    return result;
}

/// Classical scaling of the sources, every other vertex placed by its distances to them.
Eigen::Matrix2Xd classical_scaling(const SourceDistances& measured)
{
    const Eigen::Index k = std::ssize(measured.sources);
    Eigen::MatrixXd squared(k, k);
    for (Eigen::Index i = 0; i < k; ++i) {
        squared.row(i) = measured.distances.row(measured.sources[static_cast<std::size_t>(i)]).array().square();
    }
    squared = (0.5 * (squared + squared.transpose())).eval();
    const Eigen::RowVectorXd means = squared.colwise().mean();
    Eigen::MatrixXd gram = squared.rowwise() - means;
    gram.colwise() -= gram.rowwise().mean().eval();
    gram *= -0.5;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
    Eigen::Matrix2Xd layout(2, measured.distances.rows());
    for (int axis = 0; axis < 2; ++axis) {
        const Eigen::VectorXd direction =
            eigen.eigenvectors().col(k - 1 - axis) / std::sqrt(std::max(eigen.eigenvalues()(k - 1 - axis), 1e-300));
        const Eigen::MatrixXd offsets = (-measured.distances.array().square()).matrix().rowwise() + means;
        layout.row(axis) = (0.5 * offsets * direction).transpose();
    }
    return layout;
}

/// The stress of a layout, its gradient and a bound of its curvature.
class Stress
{
public:
    Stress(const SourceDistances& measured, const Eigen::VectorXd& importances)
        : measured_(measured), importances_(importances)
    {
        for (Eigen::Index i = 0; i < std::ssize(measured.sources); ++i) {
            const double weight = importances(measured.sources[static_cast<std::size_t>(i)]);
            norm_ += weight * measured.distances.col(i).cwiseAbs2().dot(importances);
        }
    }

    /// sum w (d - g)^2 / sum w g^2; adds its gradient (2n) and the diagonal of the majorising quadratic if given.
    double value(const Eigen::Matrix2Xd& layout, Eigen::VectorXd* gradient = nullptr,
                 Eigen::VectorXd* curvature = nullptr) const
    {
        double sum = 0.0;
        for (Eigen::Index i = 0; i < std::ssize(measured_.sources); ++i) {
            const int source = measured_.sources[static_cast<std::size_t>(i)];
            for (Eigen::Index v = 0; v < measured_.distances.rows(); ++v) {
                const Eigen::Vector2d offset = layout.col(v) - layout.col(source);
                const double distance = offset.norm();
                const double excess = distance - measured_.distances(v, i);
                const double weight = importances_(source) * importances_(v) / norm_;
                sum += weight * excess * excess;
                if (gradient != nullptr && v != source) {
                    const Eigen::Vector2d slope = 2.0 * weight * excess / std::max(distance, 1e-12) * offset;
                    gradient->segment<2>(2 * v) += slope;
                    gradient->segment<2>(2 * source) -= slope;
                    curvature->segment<2>(2 * v).array() += 2.0 * weight;
                    curvature->segment<2>(2 * source).array() += 2.0 * weight;
                }
            }
        }
        return sum;
    }

    /// The factor of the layout that makes the stress smallest.
    [[nodiscard]] double best_scale(const Eigen::Matrix2Xd& layout) const
    {
        double mixed = 0.0;
        double squared = 0.0;
        for (Eigen::Index i = 0; i < std::ssize(measured_.sources); ++i) {
            const int source = measured_.sources[static_cast<std::size_t>(i)];
            for (Eigen::Index v = 0; v < measured_.distances.rows(); ++v) {
                const double distance = (layout.col(v) - layout.col(source)).norm();
                const double weight = importances_(source) * importances_(v);
                mixed += weight * distance * measured_.distances(v, i);
                squared += weight * distance * distance;
            }
        }
        return mixed / squared;
    }

    /// Kruskal's stress at the best scale.
    [[nodiscard]] double scaled_stress(const Eigen::Matrix2Xd& layout) const
    {
        return std::sqrt(value(best_scale(layout) * layout));
    }

private:
    const SourceDistances& measured_;
    const Eigen::VectorXd& importances_;
    double norm_ = 0.0;
};

/// Lowers stress + weight * barrier from a fold-free layout, the weight falling from 1 to options.barrier_weight.
void lower_stress(const Disc& disc, const Stress& stress, const detail::FoldBarrier& barrier,
                  const IsomapOptions& options, Eigen::Matrix2Xd& layout, IsomapEmbedding& result)
{
    constexpr double relative_tolerance = 1e-5;
    constexpr double weight_factor = 0.5;
    const Eigen::Index n = layout.cols();
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
    double weight = std::max(1.0, options.barrier_weight);
    for (result.num_iterations = 0; result.num_iterations < options.max_iterations; ++result.num_iterations) {
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(2 * n);
        Eigen::VectorXd curvature = Eigen::VectorXd::Zero(2 * n);
        std::vector<Eigen::Triplet<double>> entries;
        const double before = stress.value(layout, &gradient, &curvature) + weight * barrier.value(layout);
        barrier.add_derivatives(layout, weight, gradient, entries);
        for (int i = 0; i < 2 * n; ++i) {
            entries.emplace_back(i, i, curvature(i));
        }
        Eigen::SparseMatrix<double> hessian(2 * n, 2 * n);
        hessian.setFromTriplets(entries.begin(), entries.end());
        if (result.num_iterations == 0) {
            solver.analyzePattern(hessian);
        }
        solver.factorize(hessian);
        const Eigen::VectorXd solution = solver.solve(-gradient);
        Eigen::Matrix2Xd step = Eigen::Map<const Eigen::Matrix2Xd>(solution.data(), 2, n);
        make_layout_symmetric(step, disc);
        const double slope = gradient.dot(Eigen::Map<const Eigen::VectorXd>(step.data(), 2 * n));

        double after = before;
        for (double length = barrier.longest_step(layout, step); length > 1e-12; length *= 0.5) {
            const Eigen::Matrix2Xd moved = layout + length * step;
            const double energy = stress.value(moved) + weight * barrier.value(moved);
            if (energy <= before + 1e-4 * length * slope) {
                layout = moved;
                after = energy;
                break;
            }
        }
        const bool is_settled =
            !(before - after > (weight > options.barrier_weight ? 0.02 : relative_tolerance) * before);
        if (is_settled && weight <= options.barrier_weight) {
            result.status = IsomapStatus::converged;
            break;
        }
        if (is_settled) {
            weight = std::max(weight_factor * weight, options.barrier_weight);
        }
    }
}

/// Turns a layout without symmetry so that it agrees best with the surface seen from the front.
void turn_upright(Eigen::Matrix2Xd& layout, const Disc& disc)
{
    const Eigen::Matrix2Xd front = disc.vertices.topRows<2>().colwise() - disc.vertices.topRows<2>().rowwise().mean();
    const Eigen::Matrix2d mixed = front * layout.transpose();
    const double angle = std::atan2(mixed(1, 0) - mixed(0, 1), mixed.trace());
    layout = (Eigen::Rotation2Dd(angle).toRotationMatrix() * layout).eval();
}

/// Fits the layout (y up, any place and size) into the unit square (v down); mirrored exactly in floats.
double fit_into_square(const Eigen::Matrix2Xd& layout, const Disc& disc, Eigen::Matrix2Xf& uv)
{
    const Eigen::Vector2d low = layout.rowwise().minCoeff();
    const Eigen::Vector2d high = layout.rowwise().maxCoeff();
    const double scale = (1.0 - 2.0 * uv_margin) / (high - low).maxCoeff();
    const Eigen::Vector2d center = 0.5 * (low + high);
    uv.resize(2, layout.cols());
    for (int v = 0; v < layout.cols(); ++v) {
        uv(0, v) = static_cast<float>(0.5 + scale * (layout(0, v) - center.x()));
        uv(1, v) = static_cast<float>(0.5 - scale * (layout(1, v) - center.y()));
    }
    for (int v = 0; disc.is_symmetric && v < layout.cols(); ++v) {
        const int partner = disc.mirror(v);
        if (partner == v) {
            uv(0, v) = 0.5F;
        } else if (uv(0, v) >= 0.5F) { // 1 - u is exact from this side
            uv(0, partner) = 1.0F - uv(0, v);
            uv(1, partner) = uv(1, v);
        }
    }
    return scale;
}

} // namespace

void IsomapOptions::check(Eigen::Index num_vertices) const
{
    const char* function = "IsomapOptions";
    if (importances.size() != 0) {
        require_size(importances.size(), num_vertices, function, "importances");
        require_finite(importances, function, "importances");
        require(importances.minCoeff() > 0.0, function, "importances", "numbers > 0", to_text(importances.minCoeff()));
    }
    require(num_sources >= 3, function, "num_sources", "a count >= 3", std::to_string(num_sources));
    require(std::isfinite(barrier_weight) && barrier_weight > 0.0, function, "barrier_weight", "a number > 0",
            to_text(barrier_weight));
    require(max_iterations >= 1, function, "max_iterations", "a count >= 1", std::to_string(max_iterations));
}

IsomapEmbedding compute_isomap_embedding(const Mesh& mesh, const Eigen::VectorXi& mirror, const IsomapOptions& options)
{
    options.check(mesh.num_vertices());
    require_finite(mesh.vertices, function_name, "vertices");
    detail::require_manifold(mesh.triangles, mesh.num_vertices(), function_name);
    detail::require_mirror(mirror, mesh.triangles, mesh.num_vertices(), function_name);
    const Disc disc = make_disc(mesh, mirror);
    const Eigen::VectorXd angles = border_angles(disc);

    Eigen::VectorXd importances = Eigen::VectorXd::Ones(disc.vertices.cols());
    if (options.importances.size() != 0) {
        importances.head(disc.num_real) = options.importances;
        importances.tail(disc.vertices.cols() - disc.num_real).setConstant(options.importances.mean());
    }
    const Eigen::VectorXd real_importances = importances.head(disc.num_real);
    const SourceDistances measured = measure_distances(disc, options.num_sources);
    const Stress stress(measured, real_importances);

    IsomapEmbedding result;
    const Eigen::Matrix2Xd reference = classical_scaling(measured);
    result.mds_stress = stress.scaled_stress(reference);
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        result.num_mds_folds += detail::doubled_area(reference, mesh.triangles.col(t)) < 0.0 ? 1 : 0;
    }
    result.num_mds_folds =
        std::min(result.num_mds_folds, static_cast<int>(mesh.num_triangles()) - result.num_mds_folds);

    Eigen::Matrix2Xd layout = detail::tutte_embedding(disc.vertices, disc.triangles, disc.border, angles);
    make_layout_symmetric(layout, disc);
    layout *= stress.best_scale(layout);
    result.start_stress = stress.scaled_stress(layout);
    const detail::FoldBarrier barrier(disc.vertices, disc.triangles, importances);
    if (std::isfinite(barrier.value(layout))) { // a very deep surface shrinks below the precision of the start
        lower_stress(disc, stress, barrier, options, layout, result);
    }

    if (!disc.is_symmetric) {
        turn_upright(layout, disc);
    }
    result.stress = stress.scaled_stress(layout);
    const double scale = fit_into_square(layout.leftCols(disc.num_real), disc, result.uv_coordinates);
    result.scale_per_mm = scale / stress.best_scale(layout);
    Eigen::Matrix2Xd returned = result.uv_coordinates.cast<double>();
    returned.row(1) *= -1.0;
    result.min_area = std::numeric_limits<double>::infinity();
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        const double area = 0.5 * detail::doubled_area(returned, mesh.triangles.col(t));
        result.min_area = std::min(result.min_area, area);
        result.num_folds += area > 0.0 ? 0 : 1;
    }
    if (result.num_folds > 0) {
        result.status = IsomapStatus::folded;
    }
    return result;
}

} // namespace lineament
