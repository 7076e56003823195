// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/fit/realtime_buffers.hpp"
#include "lineament/kernels/scalar_kernels.hpp"

#include <Eigen/Core>

#include <span>
#include <string>
#include <vector>

namespace lineament {

namespace detail {
class RealtimeFit;
class RealtimeFramesFit;
} // namespace detail

/// How the columns of the full mesh are kept.
enum class MeshStorage
{
    /// Single precision. Columns that are 16-bit integers times a power of two, as of lineament-face-1, stay integers
    /// where the kernels read them faster: half the memory, and nothing lost.
    float32,
    int16, ///< All columns, a little off where they are none: by 2^-16 of each one's largest entry.
};

/// Bytes of a mesh's columns that are read for it.
struct MeshBytes
{
    std::size_t identity = 0;   ///< Not for a FrozenIdentity.
    std::size_t expression = 0; ///< Blocks that are zero are not read, where that spares half.
};

/// A known identity with everything of its neutral face computed: made once by RealtimeFitter::freeze, good for any
/// number of frames and threads.
class FrozenIdentity
{
public:
    [[nodiscard]] const Eigen::VectorXd& shape_coefficients() const { return shape_coefficients_; }

private:
    friend class RealtimeFitter;
    friend class detail::RealtimeFit;
    friend class detail::RealtimeFramesFit;
    Eigen::VectorXd shape_coefficients_ = {};
    bool is_moderate_ = true;
    detail::NeutralShape neutral_ = {};
};

/// The memory one thread fits in: made by RealtimeFitter::make_workspace, used with that fitter only, by one thread at
/// a time. What a fit leaves in it never changes the next one.
class RealtimeWorkspace
{
public:
    /// Fits that were handed to FaceFitter as a whole: no usable pose, or a landmark given twice.
    [[nodiscard]] long num_reference_fits() const { return num_reference_fits_; }
    /// Single systems that were handed to the double precision solvers: a shape coefficient beyond its bound, or a
    /// system singular to single precision.
    [[nodiscard]] long num_reference_solves() const { return num_reference_solves_; }

private:
    friend class RealtimeFitter;
    friend class detail::RealtimeFit;
    friend class detail::RealtimeFramesFit;
    detail::RealtimeBuffers buffers_ = {};
    long num_reference_fits_ = 0;
    long num_reference_solves_ = 0;
};

/// FaceFitter's answer in microseconds: the same order of steps, in single precision on vector kernels, without
/// allocation.
///
/// With the same correspondences the two agree within 1 um of vertex distance (tested); where outline landmarks are
/// re-matched a tie within rounding may fall the other way. Whatever is rare or has no answer is left to FaceFitter
/// itself, so statuses and reasons are its own.                                                      docs/realtime.md
///
/// `const` members may run in several threads at once, each with a workspace of its own. Same input, same kernels, same
/// bits.
class RealtimeFitter
{
public:
    /// @param kernels  Those of lineament::kernels (dispatched_kernels), of the caller's own flags (highway_kernels),
    /// or
    ///                 plain C++.
    /// @throws InvalidArgument as FaceFitter, and if options.focal_length_px is set: only scaled orthographic cameras.
    explicit RealtimeFitter(MorphableModel model, std::string scheme = "ibug68", FitOptions options = {},
                            const kernels::Kernels& kernels = kernels::scalar_kernels(),
                            MeshStorage mesh_storage = MeshStorage::float32);

    [[nodiscard]] RealtimeWorkspace make_workspace() const;

    /// As FaceFitter::fit, written to `result`, whose memory is used again; of its timing the total alone.
    ///
    /// From the second call on with as many landmarks nothing is allocated, unless one of the workspace's counters
    /// rises.
    /// @param start  May be `result` itself.
    /// @throws InvalidArgument as FaceFitter::fit; then `result` is as it was.
    void fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px, RealtimeWorkspace& workspace,
             FitResult& result, const FitResult* start = nullptr) const;

    /// One identity from several images, as lineament::fit_frames with the reference, written to `result`. Whatever the
    /// number of images, the identity is one solve of the size m a round: each image leaves a few sums for each point.
    ///
    /// From the second call on with as many images nothing is allocated, as for `fit`. An image without a usable pose
    /// hands all of them to the reference.
    /// @throws InvalidArgument as lineament::fit_frames; then `result` is as it was.
    void fit_frames(std::span<const LandmarkSet> frames, const Eigen::Vector2d& principal_point_px,
                    RealtimeWorkspace& workspace, MultiFrameResult& result,
                    PriorCount prior_count = PriorCount::once) const;

    /// The identity, ready for fit_pose_and_expression.
    /// @throws InvalidArgument on more coefficients than are fitted, or one that is not finite.
    [[nodiscard]] FrozenIdentity freeze(const Eigen::VectorXd& shape_coefficients) const;

    /// As FaceFitter::fit_pose_and_expression, likewise.
    void fit_pose_and_expression(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                 const FrozenIdentity& identity, RealtimeWorkspace& workspace, FitResult& result,
                                 const FitResult* start = nullptr) const;

    /// S(a, psi) of a fit (3 x V, mm), in the workspace: good until it is used again.
    /// @throws InvalidArgument if the numbers of coefficients are not the fitter's.
    [[nodiscard]] Eigen::Map<const Eigen::Matrix3Xf> shape_of(const FitResult& fit, RealtimeWorkspace& workspace) const;

    /// The same of a frozen identity: only the expression is added.
    [[nodiscard]] Eigen::Map<const Eigen::Matrix3Xf> shape_of(const FrozenIdentity& identity, const FitResult& fit,
                                                              RealtimeWorkspace& workspace) const;

    /// shape_of of many fits at once, one a column (3 V x F, mm), the same bits. The model is read once for every 32 of
    /// them, so this is several times as fast. `shapes` is resized if it has another size.
    /// @throws InvalidArgument as shape_of; then `shapes` is as it was.
    void shapes_of(std::span<const FitResult> fits, RealtimeWorkspace& workspace, Eigen::MatrixXf& shapes) const;

    [[nodiscard]] MeshBytes mesh_bytes() const;
    [[nodiscard]] const FaceFitter& reference() const { return reference_; }
    [[nodiscard]] const kernels::Kernels& kernels() const { return *kernels_; }

private:
    friend class detail::RealtimeFit;
    friend class detail::RealtimeFramesFit;

    void check_coefficients(const FitResult& fit, const char* function) const;
    void evaluate_neutral_mesh(const Eigen::VectorXd& coefficients, float* scaled, float* out) const;
    Eigen::Map<const Eigen::Matrix3Xf> add_expression(const float* neutral, const FitResult& fit,
                                                      RealtimeWorkspace& workspace) const;

    FaceFitter reference_;
    const kernels::Kernels* kernels_;
    detail::RealtimePack pack_ = {};
};

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/realtime_fitter_impl.hpp"
#endif
