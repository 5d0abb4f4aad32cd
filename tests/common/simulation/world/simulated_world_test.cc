// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulated_world.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <vector>

#include "common/camera/camera_model.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::simulated_world_test {
namespace {

using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

Target Wand() { return *ParseTarget("wand:0,0.13,0.39"); }

SimulatedWorld MakeWorld(const std::string& options) {
  return *SimulatedWorld::Create(*ParseSimulationOptions(options), Wand());
}

// Where marker `m` truly is in the image; the wand is where it is at the frame's rig time.
Eigen::Vector2d TruePixel(const SimulatedWorld& world, int camera, int index, size_t m) {
  const WandPose wand = world.WandAt(world.FrameRigTime(camera, index));
  const SimulatedCamera& c = world.cameras()[static_cast<size_t>(camera)];
  Eigen::Vector2d pixel(-1e9, -1e9);
  Project(
      c.true_intrinsics,
      c.cam_from_rig * (wand.origin_m + world.true_target().marker_positions_m[m] * wand.direction),
      &pixel);
  return pixel;
}

// Calls `visit` for every visible marker of every frame.
void ForEachMarker(const SimulatedWorld& world,
                   const std::function<void(int camera, int index, size_t m,
                                            const MarkerObservation&, bool outlier)>& visit) {
  for (int c = 0; c < world.options().camera_count; ++c) {
    for (int k = 0; k < world.FrameCount(c); ++k) {
      std::vector<bool> outlier;
      const Observation observation = world.Observe(c, k, &outlier);
      for (size_t m = 0; m < observation.markers.size(); ++m) {
        if (observation.markers[m].visible) visit(c, k, m, observation.markers[m], outlier[m]);
      }
    }
  }
}

void ExpectSame(const Observation& a, const Observation& b) {
  EXPECT_EQ(a.time_ns, b.time_ns);
  ASSERT_EQ(a.markers.size(), b.markers.size());
  for (size_t m = 0; m < a.markers.size(); ++m) {
    EXPECT_EQ(a.markers[m].visible, b.markers[m].visible);
    EXPECT_EQ(a.markers[m].centre_px, b.markers[m].centre_px);
    EXPECT_EQ(a.markers[m].covariance_px2, b.markers[m].covariance_px2);
  }
}

TEST(SimulatedWorld, IsTheSameInEveryInstanceAndOrderOfCalls) {
  const std::string options = "seed=5;swaps=0.1;jitter=0.0001;free_running=1;clock_samples=1";
  const SimulatedWorld forward = MakeWorld(options);
  const SimulatedWorld backward = MakeWorld(options);
  std::vector<Observation> seen;
  for (int k = 0; k < 200; ++k) seen.push_back(forward.Observe(3, k));
  for (int k = 199; k >= 0; --k) {
    backward.SampleClock(3, k);
    backward.Observe(1, k);
    ExpectSame(backward.Observe(3, k), seen[static_cast<size_t>(k)]);
    ExpectSame(backward.Observe(3, k), seen[static_cast<size_t>(k)]);
    EXPECT_EQ(backward.SampleClock(3, k), forward.SampleClock(3, k));
  }
}

TEST(SimulatedWorld, DiffersByCameraFrameAndSeed) {
  const SimulatedWorld one = MakeWorld("seed=1;noise=1"), two = MakeWorld("seed=2;noise=1");
  EXPECT_NE(one.cameras()[0].cam_from_rig.translation_m,
            two.cameras()[0].cam_from_rig.translation_m);
  std::vector<double> errors;
  ForEachMarker(one, [&](int c, int k, size_t m, const MarkerObservation& marker, bool outlier) {
    if (!outlier) errors.push_back((marker.centre_px - TruePixel(one, c, k, m)).x());
  });
  ASSERT_GT(errors.size(), 1000u);
  std::sort(errors.begin(), errors.end());
  EXPECT_EQ(std::adjacent_find(errors.begin(), errors.end()), errors.end());
}

TEST(SimulatedWorld, MoreOfOneDisturbanceLeavesTheOthersAsTheyWere) {
  const SimulatedWorld few = MakeWorld("outliers=0;dropouts=0"), many = MakeWorld("outliers=0.5");
  for (int k = 0; k < 200; ++k) {
    std::vector<bool> outlier;
    const Observation with = many.Observe(0, k, &outlier);
    const Observation without = few.Observe(0, k);
    for (size_t m = 0; m < 3; ++m) {
      if (!with.markers[m].visible || outlier[m]) continue;
      EXPECT_EQ(with.markers[m].centre_px, without.markers[m].centre_px);
    }
  }
}

TEST(SimulatedWorld, WithoutDisturbanceCentresAreExact) {
  const SimulatedWorld world = MakeWorld("noise=0;outliers=0;dropouts=0");
  int count = 0;
  ForEachMarker(world, [&](int c, int k, size_t m, const MarkerObservation& marker, bool outlier) {
    EXPECT_FALSE(outlier);
    EXPECT_EQ(marker.centre_px, TruePixel(world, c, k, m));
    EXPECT_LT((marker.covariance_px2 - 0.0025 * Eigen::Matrix2d::Identity()).norm(), 1e-15);
    EXPECT_EQ(marker.centre_kind, CentreKind::kSphereCentre);
    EXPECT_EQ(marker.time_delta_ns, 0);
    ++count;
  });
  EXPECT_GT(count, 10000);
}

// Bounds: five sigma of the counts and means.
TEST(SimulatedWorld, NoiseOutliersAndDropoutsHaveTheirShares) {
  const SimulatedWorld clean = MakeWorld("outliers=0;dropouts=0");
  const SimulatedWorld world = MakeWorld("noise=0.4;outliers=0.05;dropouts=0.1");
  int possible = 0;
  ForEachMarker(clean, [&](int, int, size_t, const MarkerObservation&, bool) { ++possible; });
  int visible = 0, outliers = 0;
  double sum = 0, squares = 0, far = 0;
  Eigen::Vector2d outlier_mean = Eigen::Vector2d::Zero();
  ForEachMarker(world, [&](int c, int k, size_t m, const MarkerObservation& marker, bool outlier) {
    ++visible;
    const Eigen::Vector2d error = marker.centre_px - TruePixel(world, c, k, m);
    ASSERT_DOUBLE_EQ(marker.covariance_px2(0, 0), 0.16);
    if (outlier) {
      ++outliers;
      outlier_mean += marker.centre_px;
      if (error.norm() > 20) ++far;
      return;
    }
    sum += error.x() + error.y();
    squares += error.squaredNorm();
  });
  const double p = static_cast<double>(possible);
  EXPECT_NEAR(visible / p, 0.9, 5 * std::sqrt(0.09 / p) + 0.001);
  const double v = static_cast<double>(visible);
  EXPECT_NEAR(outliers / v, 0.05, 5 * std::sqrt(0.05 / v));
  EXPECT_GT(far, 0.95 * outliers);
  const double n = 2.0 * (visible - outliers);
  EXPECT_NEAR(sum / n, 0, 5 * 0.4 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.4, 5 * 0.4 / std::sqrt(2 * n));
  outlier_mean /= outliers;
  EXPECT_NEAR(outlier_mean.x(), 639.5, 5 * 370 / std::sqrt(outliers));
  EXPECT_NEAR(outlier_mean.y(), 511.5, 5 * 296 / std::sqrt(outliers));
}

TEST(SimulatedWorld, OneCameraMayHaveOutliersOfItsOwn) {
  const SimulatedWorld even = MakeWorld("outliers=0.01");
  const SimulatedWorld world = MakeWorld("outliers=0.01;outliers.2=0.3");
  std::vector<double> outliers(6, 0), markers(6, 0);
  ForEachMarker(world, [&](int c, int, size_t, const MarkerObservation&, bool outlier) {
    markers[static_cast<size_t>(c)] += 1;
    outliers[static_cast<size_t>(c)] += outlier ? 1 : 0;
  });
  for (size_t c = 0; c < 6; ++c) {
    const double share = c == 2 ? 0.3 : 0.01;
    EXPECT_NEAR(outliers[c] / markers[c], share, 5 * std::sqrt(share / markers[c])) << c;
  }
  for (int k = 0; k < 100; ++k) ExpectSame(world.Observe(3, k), even.Observe(3, k));
}

TEST(SimulatedWorld, NobodySeesTheWandInTheGap) {
  const SimulatedWorld whole = MakeWorld("free_running=1");
  const SimulatedWorld world = MakeWorld("free_running=1;gap_start=20;gap=10");
  for (int c = 0; c < 6; ++c) {
    int before = 0, after = 0;
    for (int k = 0; k < world.FrameCount(c); ++k) {
      const double rig_time_s = world.FrameRigTime(c, k);
      const Observation observation = world.Observe(c, k);
      if (rig_time_s >= 20 && rig_time_s < 30) {
        EXPECT_EQ(observation.VisibleCount(), 0);
        continue;
      }
      ExpectSame(observation, whole.Observe(c, k));
      (rig_time_s < 20 ? before : after) += observation.VisibleCount();
    }
    EXPECT_GT(before, 300);
    EXPECT_GT(after, 300);
  }
}

// Bounds: five sigma of a mean and of a standard deviation over that many draws.
TEST(SimulatedWorld, TruthIsDrawnFromItsPriorsAndWhatIsToldStays) {
  const std::string drawn =
      ";cameras=10;duration=1;length_error=0.001;length_sigma=0.002;focal_sigma=0.005;"
      "centre_sigma=6.4;radial_sigma=0.03;radial_high_sigma=0.1;tangential_sigma=0.001";
  std::vector<std::vector<double>> in_sigmas(4);
  std::vector<double> spans;
  for (int seed = 1; seed <= 100; ++seed) {
    const std::string start = "seed=" + std::to_string(seed);
    const SimulatedWorld world = MakeWorld(start + drawn), plain = MakeWorld(start + ";cameras=10");
    EXPECT_EQ(world.target(), Wand());
    const std::vector<double>& positions = world.true_target().marker_positions_m;
    spans.push_back((positions[1] - 0.131) / 0.002);
    spans.push_back((positions[2] - positions[1] - 0.261) / 0.002);
    for (size_t c = 0; c < 10; ++c) {
      const Intrinsics& given = *world.cameras()[c].description.intrinsics;
      const Intrinsics& truth = world.cameras()[c].true_intrinsics;
      EXPECT_EQ(given, *plain.cameras()[c].description.intrinsics);
      EXPECT_EQ(given, plain.cameras()[c].true_intrinsics);
      in_sigmas[0].push_back((truth.fx_px / given.fx_px - 1) / 0.005);
      in_sigmas[0].push_back((truth.fy_px / given.fy_px - 1) / 0.005);
      in_sigmas[1].push_back((truth.cx_px - given.cx_px) / 6.4);
      in_sigmas[1].push_back((truth.cy_px - given.cy_px) / 6.4);
      for (const size_t i : {0, 1, 4}) {
        const double sigma = i == 4 ? 0.1 : 0.03;
        in_sigmas[2].push_back((truth.distortion[i] - given.distortion[i]) / sigma);
      }
      for (const size_t i : {2, 3}) {
        in_sigmas[3].push_back((truth.distortion[i] - given.distortion[i]) / 0.001);
      }
    }
  }
  in_sigmas.push_back(spans);
  for (const std::vector<double>& values : in_sigmas) {
    const double n = static_cast<double>(values.size());
    const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
    const double squares = std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
    EXPECT_NEAR(mean, 0, 5 / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(squares / n), 1, 5 / std::sqrt(2 * n));
  }
}

TEST(SimulatedWorld, EveryCentreIsInsideTheImageAndSeenFromInFront) {
  const SimulatedWorld world = MakeWorld("noise=20;outliers=0.2");
  ForEachMarker(world, [&](int, int, size_t, const MarkerObservation& marker, bool) {
    ASSERT_GE(marker.centre_px.x(), 0);
    ASSERT_LE(marker.centre_px.x(), 1279);
    ASSERT_GE(marker.centre_px.y(), 0);
    ASSERT_LE(marker.centre_px.y(), 1023);
  });
}

TEST(SimulatedWorld, ReversesTheLabelsOfTheShareAskedFor) {
  const SimulatedWorld straight = MakeWorld("outliers=0.3"),
                       swapped = MakeWorld("outliers=0.3;swaps=0.25");
  int reversed = 0, told_apart = 0;
  for (int k = 0; k < straight.FrameCount(0); ++k) {
    std::vector<bool> outlier, outlier_swapped;
    const Observation a = straight.Observe(0, k, &outlier);
    const Observation b = swapped.Observe(0, k, &outlier_swapped);
    if (!a.markers[0].visible) continue;
    ++told_apart;
    if (b.markers[2].visible && b.markers[2].centre_px == a.markers[0].centre_px) {
      ++reversed;
      EXPECT_EQ(outlier_swapped[2], outlier[0]);
      EXPECT_EQ(b.markers[1].visible, a.markers[1].visible);
    } else {
      EXPECT_EQ(b.markers[0].centre_px, a.markers[0].centre_px);
    }
  }
  ASSERT_GT(told_apart, 1000);
  EXPECT_NEAR(static_cast<double>(reversed) / told_apart, 0.25,
              5 * std::sqrt(0.25 * 0.75 / told_apart));
}

TEST(SimulatedWorld, StampsFollowTheClocksFormula) {
  const SimulatedWorld world = MakeWorld("offset.1=0.25;rate_ppm.1=80;offset.2=-0.008;rate.2=40");
  for (const int c : {0, 1, 2}) {
    const SimulatedCamera& camera = world.cameras()[static_cast<size_t>(c)];
    for (const int k : {0, 1, 700, 1400}) {
      const double camera_time_s =
          1e-9 * static_cast<double>(world.Observe(c, k).time_ns - camera.clock_origin_ns);
      const double rig_time_s =
          camera_time_s + camera.time_offset_s + 1e-6 * camera.time_rate_ppm * camera_time_s;
      EXPECT_NEAR(rig_time_s, world.FrameRigTime(c, k), 1e-9);
      EXPECT_DOUBLE_EQ(world.FrameRigTime(c, k), k / camera.rate_hz);
    }
  }
  // A negative offset: the row shows an earlier moment than its stamp says.
  EXPECT_GT(1e-9 * static_cast<double>(world.Observe(2, 100).time_ns), world.FrameRigTime(2, 100));
}

TEST(SimulatedWorld, JitterIsOfTheStampsOnlyAndKeepsTheirOrder) {
  const SimulatedWorld calm = MakeWorld("rate=100"), world = MakeWorld("rate=100;jitter=0.001");
  double squares = 0;
  const int frames = world.FrameCount(0);
  for (int k = 0; k < frames; ++k) {
    const Observation a = calm.Observe(0, k), b = world.Observe(0, k);
    const double jitter_s = 1e-9 * static_cast<double>(b.time_ns - a.time_ns);
    squares += jitter_s * jitter_s;
    for (size_t m = 0; m < 3; ++m) EXPECT_EQ(a.markers[m].centre_px, b.markers[m].centre_px);
    if (k > 0) {
      ASSERT_GT(b.time_ns, world.Observe(0, k - 1).time_ns);
    }
  }
  EXPECT_NEAR(std::sqrt(squares / frames), 0.001, 5 * 0.001 / std::sqrt(2.0 * frames));
}

TEST(SimulatedWorld, ClockSamplesPutUnrelatedClocksOntoRigTime) {
  const SimulatedWorld world = MakeWorld("clock_samples=1;offset.1=0.008;cameras=4");
  for (int c = 0; c < 4; ++c) {
    const SimulatedCamera& camera = world.cameras()[static_cast<size_t>(c)];
    double sum = 0, squares = 0;
    constexpr int kCount = 1000;
    for (int k = 0; k < kCount; ++k) {
      const ClockSample sample = world.SampleClock(c, k);
      EXPECT_EQ(sample.device_ns, world.Observe(c, k).time_ns);
      const double reading_s =
          1e-9 * static_cast<double>(sample.host_utc_ns) - world.FrameRigTime(c, k);
      const double mapped_s =
          1e-9 * static_cast<double>(sample.device_ns - camera.clock_origin_ns) +
          camera.time_offset_s;
      EXPECT_NEAR(mapped_s, world.FrameRigTime(c, k), 2e-9);
      sum += reading_s;
      squares += reading_s * reading_s;
    }
    const double sigma = 200e-6;
    EXPECT_NEAR(sum / kCount, 0, 5 * sigma / std::sqrt(kCount));
    EXPECT_NEAR(std::sqrt(squares / kCount), sigma, 5 * sigma / std::sqrt(2.0 * kCount));
    EXPECT_EQ(world.SampleClock(c, 0).uncertainty_ns, 200000u);
  }
}

TEST(SimulatedWorld, FramesFillTheDurationAndNothingMore) {
  const SimulatedWorld world =
      MakeWorld("duration=10;rate=30;rate.1=29.97;free_running=1;rate.2=0.1");
  for (int c = 0; c < 6; ++c) {
    const int count = world.FrameCount(c);
    ASSERT_GE(count, 1);
    EXPECT_LT(world.FrameRigTime(c, count - 1), 10);
    EXPECT_GE(world.FrameRigTime(c, count), 10 - 1e-6);
    EXPECT_EQ(world.FrameRigTime(c, 0), world.cameras()[static_cast<size_t>(c)].phase_s);
  }
  EXPECT_EQ(MakeWorld("duration=60;rate=25").FrameCount(0), 1500);
}

TEST(SimulatedWorld, WandIsOfItsTrueLengthAndTheSolverIsToldAnother) {
  const SimulatedWorld world = MakeWorld("length_error=0.004");
  EXPECT_EQ(world.target(), Wand());
  EXPECT_NEAR(world.true_target().marker_positions_m[1], 0.134, 1e-12);
  EXPECT_NEAR(world.true_target().marker_positions_m[2], 0.398, 1e-12);
  // The middle of the wand, not its end, keeps to the highest speed.
  const double h = 1e-5;
  const auto middle = [&](double t) {
    const WandPose wand = world.WandAt(t);
    return wand.At(0.199);
  };
  EXPECT_LE((middle(7 + h) - middle(7 - h)).norm() / (2 * h), 1.5);
}

TEST(SimulatedWorld, EveryCameraSeesTheWandOftenAndTheOverlapIsConnected) {
  for (const int count : {2, 4, 6, 24, 100}) {
    const SimulatedWorld world = MakeWorld("rate=5;cameras=" + std::to_string(count));
    const int frames = world.FrameCount(0);
    std::vector<std::vector<bool>> sees(static_cast<size_t>(count));
    for (int c = 0; c < count; ++c) {
      int seen = 0;
      for (int k = 0; k < frames; ++k) {
        sees[static_cast<size_t>(c)].push_back(world.Observe(c, k).VisibleCount() >= 2);
        seen += sees[static_cast<size_t>(c)].back();
      }
      EXPECT_GT(seen, 0.6 * frames) << "camera " << c << " of " << count;
    }
    // Breadth first over pairs that share at least 50 instants.
    std::vector<size_t> reached = {0};
    std::vector<bool> known(static_cast<size_t>(count), false);
    known[0] = true;
    for (size_t next = 0; next < reached.size(); ++next) {
      for (size_t other = 0; other < known.size(); ++other) {
        if (known[other]) continue;
        int shared = 0;
        for (size_t k = 0; k < static_cast<size_t>(frames); ++k) {
          shared += sees[reached[next]][k] && sees[other][k];
        }
        if (shared < 50) continue;
        known[other] = true;
        reached.push_back(other);
      }
    }
    EXPECT_EQ(reached.size(), static_cast<size_t>(count));
  }
}

TEST(SimulatedWorld, ACameraSeesOneSideOfABoard) {
  const Target target =
      *ParseTarget("board:charuco,7x5,0.06,0.045,5x5_100,two-sided=0.005;flatness=0");
  const SimulatedWorld world =
      *SimulatedWorld::Create(*ParseSimulationOptions("cameras=6;duration=6;outliers=0"), target);
  const Board board = *ParseBoard(target.board);
  int rows[2] = {0, 0};
  for (int c = 0; c < 6; ++c) {
    const SimulatedCamera& camera = world.cameras()[static_cast<size_t>(c)];
    for (int k = 0; k < world.FrameCount(c); ++k) {
      const Observation observation = world.Observe(c, k);
      const WandPose pose = world.WandAt(world.FrameRigTime(c, k));
      const Eigen::Vector3d eye =
          Eigen::Quaterniond(pose.rotation).conjugate() *
          (camera.cam_from_rig.SourceFromTargetTranslation() - pose.origin_m);
      int seen[2] = {0, 0};
      for (size_t m = 0; m < observation.markers.size(); ++m) {
        if (observation.markers[m].visible) ++seen[m < 24 ? 0 : 1];
      }
      // Its z points away from who looks at the front.
      EXPECT_EQ(eye.z() > 0.0025 ? seen[0] : seen[1], 0);
      for (const int side : {0, 1}) rows[side] += seen[side] > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(rows[0], 50);
  EXPECT_GT(rows[1], 50);
}

TEST(SimulatedWorld, SimulatesAPointAndSixteenMarkers) {
  for (const char* text :
       {"point", "wand:0,0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9,1,1.1,1.2,1.3,1.4,1.5"}) {
    ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget(text));
    ASSERT_OK_AND_ASSIGN(const SimulatedWorld world, SimulatedWorld::Create({}, target));
    int visible = 0;
    for (int k = 0; k < 100; ++k) {
      const Observation observation = world.Observe(0, k);
      ASSERT_EQ(observation.markers.size(), target.marker_positions_m.size());
      visible += observation.VisibleCount();
    }
    EXPECT_GT(visible, 50);
  }
}

TEST(SimulatedWorld, RefusesBadOptionsTargetsAndImpossibleLengthErrors) {
  SimulationOptions options;
  options.camera_count = 1;
  EXPECT_THAT(SimulatedWorld::Create(options, Wand()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cameras")));
  EXPECT_THAT(SimulatedWorld::Create({}, Target{}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("marker")));
  options = {};
  options.length_error_m = -0.1;
  ASSERT_OK_AND_ASSIGN(const Target narrow, ParseTarget("wand:0,0.05,0.39"));
  EXPECT_THAT(SimulatedWorld::Create(options, narrow),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("length_error")));
}

}  // namespace
}  // namespace rigcal::simulated_world_test
