// SPDX-License-Identifier: Apache-2.0
#include "learning.hpp"

#include "base/text.hpp"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>
#include <numbers>
#include <numeric>
#include <set>
#include <span>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace arhost::map {
namespace {

using pose::Rigid;

constexpr double degree = std::numbers::pi / 180;

// A pose in the form that Ceres optimizes: unit quaternion x y z w, translation in mm.
using Parameters = std::array<double, 7>;
using PoseManifold = ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;

Parameters parameters_of(const Rigid &pose) {
    Parameters parameters;
    Eigen::Map<Eigen::Quaterniond>(parameters.data()) = Eigen::Quaterniond(pose.rotation);
    Eigen::Map<Eigen::Vector3d>(parameters.data() + 4) = pose.translation_mm;
    return parameters;
}

Rigid pose_of(const Parameters &parameters) {
    return {Eigen::Map<const Eigen::Quaterniond>(parameters.data()).normalized().toRotationMatrix(),
            Eigen::Map<const Eigen::Vector3d>(parameters.data() + 4)};
}

class PixelOfPoint final : public ceres::SizedCostFunction<2, 3> {
public:
    explicit PixelOfPoint(const pose::Projection &projection) : projection_(projection) {}
    bool Evaluate(const double *const *point_mm, double *px, double **jacobians) const override {
        pose::Jacobian23 derivative;
        const bool is_wanted = jacobians && jacobians[0];
        const auto pixel =
            projection_.pixel(Eigen::Map<const Eigen::Vector3d>(point_mm[0]), is_wanted ? &derivative : nullptr);
        if (!pixel)
            return false;
        std::copy_n(pixel->data(), 2, px);
        if (is_wanted) {
            Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> to(jacobians[0]);
            to = derivative;
        }
        return true;
    }

private:
    const pose::Projection &projection_;
};

// The errors of a marker's four corners, in px.
struct Reprojection {
    ceres::CostFunctionToFunctor<2, 3> pixel;
    std::array<Eigen::Vector3d, 4> corners_mm;
    std::array<Eigen::Vector2d, 4> corners_px;

    template <class T> bool operator()(const T *camera_from_map, const T *map_from_marker, T *errors) const {
        const auto transform = [](const T *pose, const Eigen::Matrix<T, 3, 1> &point) -> Eigen::Matrix<T, 3, 1> {
            return Eigen::Map<const Eigen::Quaternion<T>>(pose) * point +
                   Eigen::Map<const Eigen::Matrix<T, 3, 1>>(pose + 4);
        };
        for (std::size_t i = 0; i < 4; ++i) {
            const Eigen::Matrix<T, 3, 1> point =
                transform(camera_from_map, transform(map_from_marker, corners_mm[i].cast<T>()));
            if (!pixel(point.data(), errors + 2 * i))
                return false;
            errors[2 * i] -= corners_px[i].x();
            errors[2 * i + 1] -= corners_px[i].y();
        }
        return true;
    }
};

// Makes an exception of `progress` stop a long optimization. The exception must not propagate through Ceres.
class Stop final : public ceres::IterationCallback {
public:
    explicit Stop(const std::function<void(const std::string &)> &progress) : progress_(progress) {}
    ceres::CallbackReturnType operator()(const ceres::IterationSummary &) override {
        try {
            progress_("");
            return ceres::SOLVER_CONTINUE;
        } catch (...) {
            exception_ = std::current_exception();
            return ceres::SOLVER_ABORT;
        }
    }
    void rethrow() const {
        if (exception_)
            std::rethrow_exception(exception_);
    }

private:
    const std::function<void(const std::string &)> &progress_;
    std::exception_ptr exception_;
};

double median(std::vector<double> values) {
    if (values.empty())
        return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

// Returns at most `count` of the items, evenly distributed.
template <class Item> std::vector<Item> sample(const std::vector<Item> &items, std::size_t count) {
    if (items.size() <= count)
        return items;
    std::vector<Item> sampled;
    for (std::size_t i = 0; i < count; ++i)
        sampled.push_back(items[i * items.size() / count]);
    return sampled;
}

// One marker in one frame.
struct View {
    std::size_t frame, marker;
    std::array<Eigen::Vector2d, 4> corners_px;
    std::vector<Rigid> camera_from_marker; // one or two: the planar pose problem
    bool fits = true;
};

struct FrameState {
    std::vector<std::size_t> views;
    std::optional<Rigid> camera_from_map;
};

struct MarkerState {
    int id;
    double side_mm;
    std::vector<std::size_t> views;
    std::optional<Rigid> map_from_marker;
    bool is_ambiguous = false;
};

// Returns whether two poses are so close that they lead to the same minimum of the error.
bool is_near(const Rigid &a, const Rigid &b, double tolerance_mm) {
    return pose::angle_between_rad(a.rotation, b.rotation) < 12 * degree &&
           (a.translation_mm - b.translation_mm).norm() < tolerance_mm;
}

class Learner {
public:
    Learner(const std::vector<Frame> &frames, const arhost_intrinsics &camera, const Settings &settings)
        : names_(frames), projection_(camera), settings_(settings), frames_(frames.size()) {
        std::map<int, std::size_t> index;
        for (const auto &[id, side_mm] : settings.sides_mm) {
            index[id] = markers_.size();
            markers_.push_back({id, side_mm, {}, {}});
        }
        for (std::size_t frame = 0; frame < frames.size(); ++frame)
            for (const Detection &detection : frames[frame].detections)
                if (const auto found = index.find(detection.id); found != index.end())
                    add_view(frame, found->second, detection);
    }

    Map learn() {
        std::vector<Refusal> refused = choose_group();
        if (group_.empty())
            return {{}, refused, {}, 0, 0, 0};
        grow();
        settings_.progress("adjusting all poses");
        adjust_all(rough);
        refuse_unfit(refused);
        anchor();
        for (int round = 0; round < 3 && revise(); ++round)
            adjust_all(rough);
        classify();
        while (refuse_unfit(refused))
            classify();
        anchor();
        Map map = report();
        std::ranges::sort(refused, {}, &Refusal::id);
        map.refused = refused;
        return map;
    }

private:
    static constexpr double rough = 1e-4; // relative change of the cost in the last step of an optimization

    struct Variable { // the variables of an optimization
        std::set<std::size_t> markers;
        std::vector<std::size_t> frames;
    };

    void add_view(std::size_t frame, std::size_t marker, const Detection &detection) {
        const pose::ObservedMarker observed{pose::square_corners_mm(markers_[marker].side_mm), detection.corners_px,
                                            1};
        View view{frame, marker, detection.corners_px, {}};
        for (const pose::Estimate &estimate : estimate_poses(std::span(&observed, 1), projection_))
            view.camera_from_marker.push_back(estimate.camera_from_target);
        if (view.camera_from_marker.empty())
            return;
        frames_[frame].views.push_back(views_.size());
        markers_[marker].views.push_back(views_.size());
        views_.push_back(std::move(view));
    }

    // Returns the number of frames that show this marker together with some of the others.
    template <class IsOther> std::size_t shared_frames(std::size_t marker, const IsOther &is_other) const {
        return static_cast<std::size_t>(std::ranges::count_if(markers_[marker].views, [&](std::size_t view) {
            return std::ranges::any_of(frames_[views_[view].frame].views, [&](std::size_t other) {
                return views_[other].marker != marker && is_other(views_[other].marker);
            });
        }));
    }

    // Returns all markers that are connected with this one through common frames.
    std::set<std::size_t> group_of(std::size_t seed) const {
        std::set<std::size_t> group{seed};
        for (bool grows = true; grows;) {
            grows = false;
            for (std::size_t marker = 0; marker < markers_.size(); ++marker)
                if (!group.contains(marker) &&
                    shared_frames(marker, [&](std::size_t other) { return group.contains(other); }) >= min_views)
                    grows = group.insert(marker).second;
        }
        return group;
    }

    // Chooses the largest group of connected markers, or the group that contains `origin`. Returns the markers
    // outside of the chosen group.
    std::vector<Refusal> choose_group() {
        std::vector<std::size_t> seeds(markers_.size());
        std::iota(seeds.begin(), seeds.end(), 0);
        std::ranges::stable_sort(seeds, std::greater{}, [&](std::size_t m) { return markers_[m].views.size(); });
        std::set<std::size_t> done;
        for (const std::size_t seed : seeds) {
            if (done.contains(seed))
                continue;
            const std::set<std::size_t> group = group_of(seed);
            done.insert(group.begin(), group.end());
            const bool has_origin = !settings_.origin || std::ranges::any_of(group, [&](std::size_t marker) {
                return markers_[marker].id == *settings_.origin;
            });
            if (has_origin && group.size() > group_.size()) {
                group_ = group;
                seed_ = seed;
            }
        }
        if (settings_.origin && group_.size() < 2)
            throw std::runtime_error(
                fmt::format("marker {} cannot be the origin: it was not seen together with other "
                            "markers in {} frames or more",
                            *settings_.origin, min_views));
        if (group_.size() < 2)
            group_.clear();
        std::vector<Refusal> refused;
        for (std::size_t marker = 0; marker < markers_.size(); ++marker) {
            const std::size_t seen = markers_[marker].views.size();
            if (group_.contains(marker) || seen == 0)
                continue;
            const std::size_t shared =
                shared_frames(marker, [&](std::size_t other) { return group_.empty() || group_.contains(other); });
            const auto frames = [](std::size_t count) { return "only " + base::count_of(count, "frame"); };
            refused.push_back(
                {markers_[marker].id,
                 seen < min_views ? fmt::format("was seen in {}; at least {} are needed", frames(seen), min_views)
                 : shared == 0    ? "was never seen together with the other markers; show them in the same frames"
                               : fmt::format("was seen together with the other markers in {}; at least {} are needed",
                                             frames(shared), min_views)});
        }
        return refused;
    }

    bool is_placed(std::size_t marker) const { return markers_[marker].map_from_marker.has_value(); }

    std::vector<pose::ObservedMarker> observed(std::size_t frame, std::optional<std::size_t> without = {}) const {
        std::vector<pose::ObservedMarker> result;
        for (const std::size_t index : frames_[frame].views) {
            const View &view = views_[index];
            const MarkerState &marker = markers_[view.marker];
            if (!is_placed(view.marker) || view.marker == without)
                continue;
            pose::ObservedMarker &observed = result.emplace_back();
            observed.corners_on_target_mm = pose::square_corners_mm(marker.side_mm);
            for (Eigen::Vector3d &corner : observed.corners_on_target_mm)
                corner = *marker.map_from_marker * corner;
            observed.corners_px = view.corners_px;
            observed.corner_sigma_px = 0.2;
        }
        return result;
    }

    // Returns the RMS over the corners; nullopt if frame or marker have no pose or the camera cannot see the marker
    // there.
    std::optional<double> error_px(const View &view) const {
        const auto &camera_from_map = frames_[view.frame].camera_from_map;
        const MarkerState &marker = markers_[view.marker];
        if (!camera_from_map || !marker.map_from_marker)
            return {};
        return error_px(view, *camera_from_map * *marker.map_from_marker);
    }
    std::optional<double> error_px(const View &view, const Rigid &camera_from_marker) const {
        const auto corners = pose::square_corners_mm(markers_[view.marker].side_mm);
        double squares = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            const auto pixel = projection_.pixel(camera_from_marker * corners[i]);
            if (!pixel)
                return {};
            squares += (*pixel - view.corners_px[i]).squaredNorm();
        }
        return std::sqrt(squares / 4);
    }

    // Returns the views of a frame that fit. If there is only one, returns none, because a single view contains no
    // information about the map.
    std::vector<std::size_t> useful_views_of(std::size_t frame) const {
        std::vector<std::size_t> useful;
        for (const std::size_t view : frames_[frame].views)
            if (views_[view].fits && error_px(views_[view]))
                useful.push_back(view);
        return useful.size() < 2 ? std::vector<std::size_t>() : useful;
    }

    double typical_error_px() const {
        std::vector<double> errors;
        for (const View &view : views_)
            if (view.fits)
                if (const auto error = error_px(view))
                    errors.push_back(*error);
        return std::max(median(errors), 0.02);
    }

    // Minimizes the reprojection error over the poses of some frames and markers. Returns half the sum of the squared
    // errors; errors beyond three times the typical ones count less. `sigmas` receives the standard deviations of the
    // markers.
    double adjust(const Variable &variable, double typical_px, double tolerance,
                  std::map<std::size_t, std::pair<double, double>> *sigmas = nullptr) {
        ceres::Problem::Options ownership;
        ownership.manifold_ownership = ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
        PoseManifold manifold;
        ceres::CauchyLoss loss(2 * 3 * typical_px); // the norm of a view's 8 errors is twice their RMS
        ceres::Problem problem(ownership);
        std::map<std::size_t, Parameters> frames, markers;
        auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
        for (const std::size_t frame : variable.frames)
            for (const std::size_t index : useful_views_of(frame)) {
                const View &view = views_[index];
                double *camera_from_map =
                    frames.try_emplace(frame, parameters_of(*frames_[frame].camera_from_map)).first->second.data();
                double *map_from_marker =
                    markers.try_emplace(view.marker, parameters_of(*markers_[view.marker].map_from_marker))
                        .first->second.data();
                // The functor is not copyable, so it must be constructed in place.
                auto *cost = new ceres::AutoDiffCostFunction<Reprojection, 8, 7, 7>(
                    new Reprojection{ceres::CostFunctionToFunctor<2, 3>(new PixelOfPoint(projection_)),
                                     pose::square_corners_mm(markers_[view.marker].side_mm), view.corners_px});
                problem.AddResidualBlock(cost, &loss, camera_from_map, map_from_marker);
            }
        for (auto &[frame, parameters] : frames) {
            problem.SetManifold(parameters.data(), &manifold);
            ordering->AddElementToGroup(parameters.data(), 0);
        }
        for (auto &[marker, parameters] : markers) {
            problem.SetManifold(parameters.data(), &manifold);
            ordering->AddElementToGroup(parameters.data(), 1);
            if (!variable.markers.contains(marker) || marker == fixed_)
                problem.SetParameterBlockConstant(parameters.data());
        }
        Stop stop(settings_.progress);
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::SPARSE_SCHUR;
        options.linear_solver_ordering = ordering;
        options.max_num_iterations = 100;
        options.function_tolerance = tolerance;
        options.logging_type = ceres::SILENT;
        options.callbacks.push_back(&stop);
        ceres::Solver::Summary summary;
        if (!frames.empty())
            ceres::Solve(options, &problem, &summary);
        stop.rethrow();
        for (const auto &[frame, parameters] : frames)
            frames_[frame].camera_from_map = pose_of(parameters);
        for (const auto &[marker, parameters] : markers)
            if (variable.markers.contains(marker) && marker != fixed_)
                markers_[marker].map_from_marker = pose_of(parameters);
        if (sigmas)
            *sigmas = standard_deviations(problem, markers, typical_px);
        return summary.final_cost;
    }

    // Returns the standard deviations of position (mm) and rotation (rad), each in its most uncertain direction.
    std::map<std::size_t, std::pair<double, double>>
    standard_deviations(ceres::Problem &problem, const std::map<std::size_t, Parameters> &markers,
                        double typical_px) const {
        std::vector<std::pair<const double *, const double *>> blocks;
        for (const auto &[marker, parameters] : markers)
            if (!problem.IsParameterBlockConstant(parameters.data()))
                blocks.emplace_back(parameters.data(), parameters.data());
        ceres::Covariance covariance{ceres::Covariance::Options()};
        std::map<std::size_t, std::pair<double, double>> result;
        if (blocks.empty() || !covariance.Compute(blocks, &problem))
            return result;
        const double noise_px = typical_px / std::sqrt(2.0); // along each axis
        for (const auto &[marker, parameters] : markers) {
            if (problem.IsParameterBlockConstant(parameters.data()))
                continue;
            pose::Matrix6d block;
            covariance.GetCovarianceBlockInTangentSpace(parameters.data(), parameters.data(), block.data());
            const auto largest = [](const Eigen::Matrix3d &m) {
                return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues()[2]);
            };
            // The tangent of a quaternion is half the rotation vector.
            result[marker] = {noise_px * largest(block.bottomRightCorner<3, 3>()),
                              noise_px * 2 * largest(block.topLeftCorner<3, 3>())};
        }
        return result;
    }

    Variable everything() const {
        Variable all{group_, std::vector<std::size_t>(frames_.size())};
        std::iota(all.frames.begin(), all.frames.end(), 0);
        return all;
    }
    void adjust_all(double tolerance) { adjust(everything(), std::max(typical_error_px(), 0.1), tolerance); }

    void pose_frame(std::size_t frame) {
        const auto markers = observed(frame);
        const auto poses = markers.size() < 2 ? std::vector<pose::Estimate>() : estimate_poses(markers, projection_);
        frames_[frame].camera_from_map = poses.empty() ? std::nullopt : std::optional(poses[0].camera_from_target);
    }

    // Tolerance for a marker's position. The depth of a single marker is imprecise, and so is a position that was
    // computed from a single frame.
    double tolerance_mm(const MarkerState &marker) const {
        double distance_mm = 0;
        for (const std::size_t view : marker.views)
            distance_mm += views_[view].camera_from_marker[0].translation_mm.norm();
        return std::max(marker.side_mm / 2, 0.05 * distance_mm / static_cast<double>(marker.views.size()));
    }

    // Finds the pose of a marker relative to the others, which stay fixed. The candidates are the poses that single
    // frames permit. The candidates that fit best to all frames are refined, and the best result is chosen.
    void place(std::size_t index) {
        MarkerState &marker = markers_[index];
        struct Witness {
            std::size_t view;
            std::vector<Rigid> camera_from_map; // poses that follow from the other markers
        };
        std::vector<std::size_t> shared;
        for (const std::size_t view : marker.views)
            if (views_[view].fits && !observed(views_[view].frame, index).empty())
                shared.push_back(view);
        std::vector<Witness> witnesses;
        for (const std::size_t view : sample(shared, 60)) {
            Witness witness{view, {}};
            const auto others = observed(views_[view].frame, index);
            const auto &camera_from_map = frames_[views_[view].frame].camera_from_map;
            if (others.size() >= 3 && camera_from_map) // this marker has little influence on the frame's pose
                witness.camera_from_map.push_back(*camera_from_map);
            else
                for (const pose::Estimate &estimate : estimate_poses(others, projection_))
                    witness.camera_from_map.push_back(estimate.camera_from_target);
            if (!witness.camera_from_map.empty())
                witnesses.push_back(witness);
        }
        struct Candidate {
            Rigid map_from_marker;
            double cost;
        };
        std::vector<Candidate> candidates;
        for (const Witness &witness : witnesses)
            for (const Rigid &camera_from_map : witness.camera_from_map)
                for (const Rigid &camera_from_marker : views_[witness.view].camera_from_marker)
                    candidates.push_back({camera_from_map.inverse() * camera_from_marker, 0});
        if (marker.map_from_marker)
            candidates.push_back({*marker.map_from_marker, 0});
        constexpr double bound_px = 20; // limits the error of frames that are wrong or whose poses are imprecise
        for (Candidate &candidate : candidates)
            for (const Witness &witness : witnesses) {
                double least = bound_px;
                for (const Rigid &camera_from_map : witness.camera_from_map)
                    if (const auto error =
                            error_px(views_[witness.view], camera_from_map * candidate.map_from_marker))
                        least = std::min(least, *error);
                candidate.cost += least;
            }
        std::ranges::stable_sort(candidates, {}, &Candidate::cost);
        std::vector<Candidate> finalists;
        const double tolerance_mm = this->tolerance_mm(marker);
        for (const Candidate &candidate : candidates)
            if (finalists.size() < 4 && std::ranges::none_of(finalists, [&](const Candidate &other) {
                    return is_near(other.map_from_marker, candidate.map_from_marker, tolerance_mm);
                }))
                finalists.push_back(candidate);

        Variable variable{{index}, {}};
        witnesses = sample(witnesses, 20);
        for (const Witness &witness : witnesses)
            variable.frames.push_back(views_[witness.view].frame);
        const double typical_px = std::max(typical_error_px(), 0.1);
        const std::vector<FrameState> before = frames_;
        for (Candidate &finalist : finalists) {
            marker.map_from_marker = finalist.map_from_marker;
            for (const Witness &witness : witnesses) {
                const View &view = views_[witness.view];
                frames_[view.frame].camera_from_map =
                    *std::ranges::min_element(witness.camera_from_map, {}, [&](const Rigid &camera_from_map) {
                        return error_px(view, camera_from_map * finalist.map_from_marker).value_or(INFINITY);
                    });
            }
            const double lost = static_cast<double>(std::ranges::count_if(
                witnesses, [&](const Witness &witness) { return !error_px(views_[witness.view]); }));
            finalist.cost = adjust(variable, typical_px, rough) + lost * bound_px * bound_px;
            finalist.map_from_marker = *marker.map_from_marker;
            frames_ = before;
        }
        std::ranges::stable_sort(finalists, {}, &Candidate::cost);
        marker.map_from_marker.reset();
        if (finalists.empty())
            return;
        marker.map_from_marker = finalists[0].map_from_marker;
        // Corresponds to a likelihood ratio of e^8.
        const double margin = 8 * typical_px * typical_px / 2;
        marker.is_ambiguous = std::ranges::any_of(finalists, [&](const Candidate &other) {
            return other.cost < finalists[0].cost + margin &&
                   !is_near(other.map_from_marker, finalists[0].map_from_marker, tolerance_mm) &&
                   (other.map_from_marker.translation_mm - finalists[0].map_from_marker.translation_mm).norm() <
                       tolerance_mm;
        });
    }

    // Places one marker after the other. Markers that are seen best together with placed markers come first.
    void grow() {
        fixed_ = seed_;
        for (const Marker &given : settings_.layout)
            for (const std::size_t marker : group_)
                if (markers_[marker].id == given.id)
                    markers_[marker].map_from_marker = given.map_from_marker;
        std::size_t placed = 0, adjusted = 0;
        for (const std::size_t marker : group_)
            placed += is_placed(marker);
        if (placed == 0) {
            markers_[seed_].map_from_marker = Rigid();
            placed = 1;
        } else if (!is_placed(seed_)) {
            fixed_ = *std::ranges::find_if(group_, [&](std::size_t marker) { return is_placed(marker); });
        }
        for (std::size_t frame = 0; frame < frames_.size(); ++frame)
            pose_frame(frame);
        while (placed < group_.size()) {
            std::optional<std::size_t> next;
            std::size_t most = 0;
            for (const std::size_t marker : group_) {
                if (is_placed(marker) || skipped_.contains(marker))
                    continue;
                std::size_t support = 0;
                for (const std::size_t view : markers_[marker].views)
                    support += std::min<std::size_t>(observed(views_[view].frame).size(), 3);
                if (support > most) {
                    most = support;
                    next = marker;
                }
            }
            if (!next)
                break;
            place(*next);
            if (!is_placed(*next)) {
                skipped_.insert(*next);
                continue;
            }
            // Frames with many markers keep their poses, because one marker changes such a pose little.
            for (const std::size_t view : markers_[*next].views)
                if (const std::size_t frame = views_[view].frame;
                    !frames_[frame].camera_from_map || observed(frame).size() <= 4)
                    pose_frame(frame);
            ++placed;
            settings_.progress(fmt::format("{} of {} markers placed", placed, group_.size()));
            if (5 * placed >= 6 * adjusted) { // a small map is adjusted after each marker
                adjust_all(rough);
                adjusted = placed;
            }
        }
    }

    // Places each marker again, now that all markers are known. Returns whether the pose of one has changed.
    bool revise() {
        settings_.progress("checking all poses");
        for (std::size_t frame = 0; frame < frames_.size(); ++frame)
            pose_frame(frame);
        bool has_changed = false;
        for (const std::size_t marker : group_) {
            settings_.progress("");
            if (!is_placed(marker) || marker == fixed_)
                continue;
            const Rigid before = *markers_[marker].map_from_marker;
            place(marker);
            if (is_placed(marker) &&
                !is_near(*markers_[marker].map_from_marker, before, tolerance_mm(markers_[marker])))
                has_changed = true;
            else
                markers_[marker].map_from_marker = before;
        }
        if (has_changed)
            for (std::size_t frame = 0; frame < frames_.size(); ++frame)
                pose_frame(frame);
        return has_changed;
    }

    // Decides which views fit, and adjusts the map to those views.
    void classify() {
        for (int round = 0; round < 3; ++round) {
            adjust_all(rough);
            const double limit_px = std::max(4 * typical_error_px(), 0.3);
            for (View &view : views_)
                if (const auto error = error_px(view))
                    view.fits = *error <= limit_px;
        }
    }

    std::size_t useful_views(std::size_t marker) const {
        return static_cast<std::size_t>(std::ranges::count_if(markers_[marker].views, [&](std::size_t view) {
            return std::ranges::count(useful_views_of(views_[view].frame), view) > 0;
        }));
    }

    // Removes markers that too few views support from the map, and returns whether there were any.
    bool refuse_unfit(std::vector<Refusal> &refused) {
        const std::size_t before = group_.size();
        for (const std::size_t marker : group_) {
            const std::size_t views = is_placed(marker) ? useful_views(marker) : 0;
            if (views >= min_views)
                continue;
            refused.push_back(
                {markers_[marker].id,
                 fmt::format("fits to the other markers in only {} of the {} frames that show it; it was "
                             "moved, or another marker has the same id",
                             views, markers_[marker].views.size())});
            markers_[marker].map_from_marker.reset();
        }
        std::erase_if(group_, [&](std::size_t marker) { return !is_placed(marker); });
        if (!group_.contains(fixed_) && !group_.empty())
            fixed_ = *group_.begin();
        return group_.size() < before;
    }

    // Transforms the map to its final frame.
    void anchor() {
        if (group_.empty())
            return;
        const auto find = [&](int id) {
            return std::ranges::find_if(group_, [&](std::size_t marker) { return markers_[marker].id == id; });
        };
        auto origin = group_.end();
        Rigid wanted;
        if (settings_.origin) {
            origin = find(*settings_.origin);
            if (origin == group_.end())
                throw std::runtime_error(
                    fmt::format("marker {} cannot be the origin: it does not fit to the others", *settings_.origin));
        } else {
            for (const Marker &given : settings_.layout)
                if (const auto found = find(given.id);
                    found != group_.end() && (origin == group_.end() || *found < *origin)) {
                    origin = found;
                    wanted = given.map_from_marker;
                }
            if (!settings_.layout.empty() && origin == group_.end())
                throw std::runtime_error("none of the layout's markers is in the map, so it cannot have the layout's "
                                         "frame; add images that show them together with the others, or choose a "
                                         "frame with --origin");
        }
        fixed_ = origin == group_.end() ? *group_.begin() : *origin;
        move_map(wanted * markers_[fixed_].map_from_marker->inverse());
        if (settings_.is_plane)
            move_map(plane_from_map());
    }

    void move_map(const Rigid &new_from_old) {
        for (const std::size_t marker : group_)
            markers_[marker].map_from_marker = new_from_old * *markers_[marker].map_from_marker;
        for (FrameState &frame : frames_)
            if (frame.camera_from_map)
                frame.camera_from_map = *frame.camera_from_map * new_from_old.inverse();
    }

    // Returns a frame whose plane z = 0 fits the markers' corners best. Its origin and x axis are the projections of
    // those of the map onto that plane.
    Rigid plane_from_map() const {
        std::vector<Eigen::Vector3d> points;
        Eigen::Vector3d centre = Eigen::Vector3d::Zero(), front = Eigen::Vector3d::Zero();
        for (const std::size_t marker : group_) {
            front += markers_[marker].map_from_marker->rotation.col(2);
            for (const Eigen::Vector3d &corner : pose::square_corners_mm(markers_[marker].side_mm)) {
                points.push_back(*markers_[marker].map_from_marker * corner);
                centre += points.back();
            }
        }
        centre /= static_cast<double>(points.size());
        Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
        for (const Eigen::Vector3d &point : points)
            spread += (point - centre) * (point - centre).transpose();
        Eigen::Vector3d z = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
        if (z.dot(front) < 0)
            z = -z;
        const Rigid &origin = *markers_[fixed_].map_from_marker;
        Eigen::Vector3d x = origin.rotation.col(0);
        x = (x - z.dot(x) * z).normalized();
        Rigid map_from_plane;
        map_from_plane.rotation << x, z.cross(x), z;
        map_from_plane.translation_mm = origin.translation_mm - z.dot(origin.translation_mm - centre) * z;
        return map_from_plane.inverse();
    }

    Map report() {
        Map map;
        std::map<std::size_t, std::pair<double, double>> sigmas;
        adjust(everything(), typical_error_px(), 1e-10, &sigmas);
        double squares = 0;
        std::size_t views = 0;
        for (const std::size_t index : group_) {
            const MarkerState &marker = markers_[index];
            LearnedMarker learned;
            static_cast<Marker &>(learned) = {marker.id, marker.side_mm, *marker.map_from_marker};
            double sum = 0;
            for (const std::size_t view : marker.views) {
                const auto error = error_px(views_[view]);
                learned.misfits += error && !views_[view].fits;
                if (std::ranges::count(useful_views_of(views_[view].frame), view) == 0)
                    continue;
                ++learned.views;
                sum += *error * *error;
            }
            learned.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(learned.views, 1)));
            squares += sum;
            views += learned.views;
            if (sigmas.contains(index))
                std::tie(learned.position_sigma_mm, learned.rotation_sigma_rad) = sigmas[index];
            learned.is_ambiguous = marker.is_ambiguous;
            map.markers.push_back(learned);
        }
        map.rms_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(views, 1)));
        map.origin = group_.empty() ? 0 : markers_[fixed_].id;
        for (std::size_t frame = 0; frame < frames_.size(); ++frame) {
            std::size_t fitting = 0, known = 0;
            for (const std::size_t view : frames_[frame].views)
                if (is_placed(views_[view].marker)) {
                    ++known;
                    fitting += views_[view].fits && error_px(views_[view]);
                }
            map.frames += fitting >= 2;
            if (known >= 2 && 2 * fitting <= known)
                map.misfits.push_back(names_[frame].name);
        }
        return map;
    }

    const std::vector<Frame> &names_;
    pose::Projection projection_;
    const Settings &settings_;
    std::vector<FrameState> frames_;
    std::vector<MarkerState> markers_; // by ascending id
    std::vector<View> views_;
    std::set<std::size_t> group_, skipped_; // the markers of the map; the markers that could not be placed
    std::size_t seed_ = 0, fixed_ = 0;
};

} // namespace

Map learn(const std::vector<Frame> &frames, const arhost_intrinsics &camera, const Settings &settings) {
    return Learner(frames, camera, settings).learn();
}

} // namespace arhost::map
