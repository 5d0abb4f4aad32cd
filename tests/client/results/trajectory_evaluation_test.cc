// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_evaluation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/testing/status_matchers.h"

namespace rigcal::client::trajectory_evaluation_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;

Eigen::Vector3d PathAt(double t) {
  return {std::sin(1.3 * t) + 0.2 * std::sin(4 * t), std::cos(1.7 * t),
          0.5 * std::sin(2.3 * t + 1)};
}

// Ground truth at 200 Hz, labels a and b half a metre apart.
Trajectories Truth() {
  Trajectories truth;
  for (int i = 0; i < 4000; ++i) {
    const double t = 0.005 * i;
    truth["a"].push_back({t, PathAt(t)});
    truth["b"].push_back({t, PathAt(t) + Eigen::Vector3d(0.5, 0, 0)});
  }
  return truth;
}

const RigidTransform kTruthFromEstimate(
    Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized())),
    Eigen::Vector3d(3, -1, 0.5));

// The same at 60 Hz in another frame, whose clock shows `offset_s` less.
Trajectories Estimate(double offset_s, double scale, double sigma_m) {
  Trajectories estimate;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1);
  const RigidTransform estimate_from_truth = kTruthFromEstimate.Inverse();
  for (int i = 0; i < 900; ++i) {
    const double t = 2 + i / 60.0;
    for (const auto& [label, x] : {std::pair("a", 0.0), std::pair("b", 0.5)}) {
      const Eigen::Vector3d position = PathAt(t) + Eigen::Vector3d(x, 0, 0);
      estimate[label].push_back(
          {t - offset_s,
           estimate_from_truth * position / scale +
               sigma_m * Eigen::Vector3d(noise(random), noise(random), noise(random))});
    }
  }
  return estimate;
}

TEST(EvaluateTrajectories, FindsMotionOffsetAndScale) {
  ASSERT_OK_AND_ASSIGN(
      const TrajectoryEvaluation rigid,
      EvaluateTrajectories(Estimate(0.1234, 1, 0), Truth(), {.longest_offset_s = 0.5}));
  EXPECT_NEAR(rigid.time_offset_s, 0.1234, 1e-5);
  EXPECT_LT(rigid.total_rmse_m, 2e-5);
  EXPECT_TRUE(rigid.truth_from_estimate.Matrix().isApprox(kTruthFromEstimate.Matrix(), 1e-4));
  EXPECT_EQ(rigid.errors.size(), 1800u);
  ASSERT_OK_AND_ASSIGN(
      const TrajectoryEvaluation similar,
      EvaluateTrajectories(Estimate(0, 1.02, 0), Truth(), {.fit_scale = true, .fit_time = false}));
  EXPECT_NEAR(similar.scale, 1.02, 1e-5);
  EXPECT_LT(similar.total_rmse_m, 2e-5);
}

// The path of both labels for a time, by a clock that is ahead.
Trajectories PartOfTruth(double spacing_s, double from_s, double length_s, double ahead_s) {
  Trajectories part;
  for (int i = 0; i < static_cast<int>(std::lround(length_s / spacing_s)); ++i) {
    const double t = from_s + spacing_s * i;
    part["a"].push_back({t + ahead_s, PathAt(t)});
    part["b"].push_back({t + ahead_s, PathAt(t) + Eigen::Vector3d(0.5, 0, 0)});
  }
  return part;
}

// An estimate of 60 s at 25 Hz, in the frame of the truth.
Trajectories Minute() { return PartOfTruth(0.04, 0, 60, 0); }

TEST(EvaluateTrajectories, FindsNoErrorWhereThereIsNone) {
  for (const double share : {0.1, 0.5, 0.9}) {
    for (const double hz : {10., 25., 50., 100., 200.}) {
      for (const double ahead_s : {0., 0.25, -0.6, 3., 180.}) {
        const Trajectories truth = PartOfTruth(1 / hz, 60 * (1 - share) / 2, 60 * share, ahead_s);
        ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                             EvaluateTrajectories(Minute(), truth, {}));
        const auto where = ::testing::Message()
                           << share << " of the time at " << hz << " Hz, " << ahead_s << " s ahead";
        EXPECT_NEAR(result.time_offset_s, ahead_s, 2e-5) << where;
        // A cubic through rows 40 ms apart misses such a motion by less than 0.1 mm.
        EXPECT_LT(result.total_rmse_m, 1e-4) << where;
        EXPECT_GT(result.errors.size(), 100u) << where;
      }
    }
  }
}

TEST(EvaluateTrajectories, FindsNoErrorWhereOnlyTheEndsOverlap) {
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                       EvaluateTrajectories(Minute(), PartOfTruth(0.01, 54, 60, 0.1), {}));
  EXPECT_NEAR(result.time_offset_s, 0.1, 2e-5);
  EXPECT_LT(result.total_rmse_m, 1e-4);
}

// Where two doubles are further apart than the offset is searched for.
TEST(EvaluateTrajectories, FindsTheOffsetOfGroundTruthSince1970) {
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                       EvaluateTrajectories(Minute(), PartOfTruth(0.01, 6, 54, 1.7e9), {}));
  EXPECT_NEAR(result.time_offset_s, 1.7e9, 1e-4);
  EXPECT_LT(result.total_rmse_m, 1e-3);
}

TEST(EvaluateTrajectories, TakesOneLabelOfSeveral) {
  Trajectories truth = Truth();
  truth.erase("b");
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                       EvaluateTrajectories(Estimate(0.02, 1, 0), truth, {}));
  EXPECT_LT(result.total_rmse_m, 2e-5);
  EXPECT_EQ(result.without_ground_truth, 900u);
  EXPECT_THAT(result.notes, Contains(HasSubstr("nothing of label b")));
  // The only point of each is the same one, whatever its name is.
  Trajectories one = Estimate(0.02, 1, 0), other;
  one.erase("b");
  other[""] = truth.at("a");
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation only, EvaluateTrajectories(one, other, {}));
  EXPECT_EQ(only.errors.size(), 900u);
  EXPECT_THAT(EvaluateTrajectories(Estimate(0, 1, 0), other, {}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("\"a\", \"b\""), HasSubstr("column label"))));
}

Trajectories Changed(Trajectories all, const std::function<Eigen::Vector3d(Eigen::Vector3d)>& to) {
  for (auto& [label, points] : all) {
    for (TrajectoryPoint& point : points) point.position_m = to(point.position_m);
  }
  return all;
}

TEST(EvaluateTrajectories, NamesWrongUnitsAndAxes) {
  const Trajectories millimetres =
      Changed(Truth(), [](const auto& p) -> Eigen::Vector3d { return 1000 * p; });
  const Trajectories mirrored =
      Changed(Truth(), [](const auto& p) { return Eigen::Vector3d(p.x(), p.y(), -p.z()); });
  EXPECT_THAT(EvaluateTrajectories(Estimate(0.3, 1, 0.001), millimetres, {}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("scale of 99"), HasSubstr("millimetres"))));
  EXPECT_THAT(EvaluateTrajectories(Estimate(0.3, 1, 0.001), mirrored, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mirrored")));
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation larger,
                       EvaluateTrajectories(Estimate(0, 1.05, 0), Truth(), {}));
  EXPECT_THAT(larger.notes, Contains(HasSubstr("scale of 1.049")));
}

TEST(EvaluateTrajectories, SaysWhenNoOffsetFits) {
  EXPECT_THAT(EvaluateTrajectories(Estimate(3, 1, 0), Truth(), {.longest_offset_s = 0.5}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AnyOf(HasSubstr("end of the searched"), HasSubstr("no time offset fits"))));
  const Trajectories other = Changed(PartOfTruth(0.01, 200, 60, -200), [](const auto& p) {
    return Eigen::Vector3d(std::sin(9 * p.y()), p.x() * p.z(), std::cos(7 * p.x()));
  });
  EXPECT_THAT(EvaluateTrajectories(Minute(), other, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no time offset fits")));
}

TEST(EvaluateTrajectories, ReportsTheNoiseByAxis) {
  ASSERT_OK_AND_ASSIGN(
      const TrajectoryEvaluation noisy,
      EvaluateTrajectories(Estimate(-0.02, 1, 0.002), Truth(), {.longest_offset_s = 0.1}));
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(noisy.rmse_m[i], 0.002, 0.0002);
  EXPECT_NEAR(noisy.total_rmse_m, 0.002 * std::sqrt(3), 0.0002);
  // Of the chi distribution with 3 degrees of freedom.
  EXPECT_NEAR(noisy.median_m, 0.002 * 1.538, 0.0002);
  EXPECT_NEAR(noisy.p95_m, 0.002 * 2.795, 0.0004);
  EXPECT_NEAR(noisy.time_offset_s, -0.02, 0.001);
}

TEST(EvaluateTrajectories, ReportsDriftAndOutliers) {
  Trajectories estimate = Estimate(0, 1, 0.0005);
  const Eigen::Vector3d along_x =
      kTruthFromEstimate.rotation.conjugate() * Eigen::Vector3d::UnitX();
  for (auto& [label, points] : estimate) {
    for (TrajectoryPoint& point : points) point.position_m += 0.0005 * point.time_s * along_x;
    points[100].position_m.x() += 1;
  }
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                       EvaluateTrajectories(estimate, Truth(), {.fit_time = false}));
  EXPECT_NEAR(result.drift_m_per_s.x(), 0.0005, 0.0002);
  EXPECT_NEAR(result.drift_m_per_s.y(), 0, 0.0002);
  EXPECT_NEAR(result.worst_m, 1, 0.02);
  EXPECT_LT(result.median_m, 0.003) << "an outlier does not pull the alignment";
}

TEST(EvaluateTrajectories, SaysWhatIsMissing) {
  Trajectories elsewhere = Estimate(0, 1, 0);
  for (auto& [label, points] : elsewhere) {
    for (TrajectoryPoint& point : points) point.time_s += 1000;
  }
  EXPECT_THAT(EvaluateTrajectories(elsewhere, Truth(), {.fit_time = false}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("only 0 positions"), HasSubstr("1002"))));
  Trajectories line;
  for (int i = 0; i < 100; ++i) line["a"].push_back({0.01 * i, Eigen::Vector3d(i, 2 * i, 3)});
  EXPECT_THAT(EvaluateTrajectories(line, line, {.fit_time = false}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("one line")));
  EXPECT_THAT(EvaluateTrajectories(line, line, {.longest_offset_s = -1}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("0 s or more")));
}

TEST(TrajectoryEvaluation, IsPrintedInMillimetresAndDrawn) {
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                       EvaluateTrajectories(Estimate(0, 1, 0.002), Truth(), {.fit_time = false}));
  EXPECT_THAT(FormatTrajectoryEvaluation(result),
              AllOf(HasSubstr("1800 positions"), HasSubstr("RMSE"), HasSubstr("mm/min")));
  const auto json = nlohmann::json::parse(ToJson(result));
  EXPECT_EQ(json.at("count"), 1800);
  EXPECT_NEAR(json.at("total_rmse_m").get<double>(), 0.002 * std::sqrt(3), 0.0002);
  EXPECT_THAT(PlotAsSvg(result),
              AllOf(HasSubstr("<svg"), HasSubstr("x (mm)"), HasSubstr("</svg>")));
}

}  // namespace
}  // namespace rigcal::client::trajectory_evaluation_test
