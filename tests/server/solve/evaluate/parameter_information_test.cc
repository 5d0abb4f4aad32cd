// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/parameter_information.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::parameter_information_test {
namespace {

using ::rigcal::testing::IsOk;
using Kind = ParameterInformation::Kind;

constexpr double kRateHz = 20;

SimulatedWorld World() {
  SimulationOptions options;
  options.camera_count = 4;
  options.duration_s = 40;
  options.rate_hz = kRateHz;
  options.outlier_share = 0;
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(options, target);
}

// Rows of a camera by time, all in one session.
void Keep(CameraTrack* track, double from_s, double to_s) {
  const auto begin = track->observations.begin();
  track->observations = {begin + static_cast<std::ptrdiff_t>(from_s * kRateHz),
                         begin + static_cast<std::ptrdiff_t>(to_s * kRateHz)};
}

CalibrationInput Session(const SimulatedWorld& world, double from_s, double to_s,
                         const std::string& id) {
  CalibrationInput input = InputOf(world);
  for (CameraTrack& track : input.tracks) {
    Keep(&track, from_s, to_s);
    track.session_id = id;
  }
  return input;
}

CalibrationInput Both(CalibrationInput a, CalibrationInput b) {
  for (CameraTrack& track : b.tracks) a.tracks.push_back(std::move(track));
  return a;
}

CalibrationInformation InformationOf(CalibrationInput input) {
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  options.trajectory = TrajectoryChoice::kInterpolated;
  const CalibrationOutcome outcome = Calibrate(std::move(input), options);
  EXPECT_THAT(outcome.result, IsOk());
  if (!outcome.result.ok() || !outcome.result->information) {
    ADD_FAILURE() << "no information";
    return {};
  }
  return *outcome.result->information;
}

int GroupOf(const CalibrationInformation& information, InformationGroup::Kind kind,
            const std::string& name) {
  const auto found = std::ranges::find_if(information.groups, [&](const InformationGroup& group) {
    return group.kind == kind && (group.session_id == name || group.camera == name);
  });
  EXPECT_NE(found, information.groups.end()) << name;
  return static_cast<int>(found - information.groups.begin());
}

// What is lost without a session is what a solve of the other one alone does not know.
TEST(ParameterInformation, OfASessionIsWhatTheOtherDoesNotKnow) {
  const SimulatedWorld world = World();
  const CalibrationInformation both =
      InformationOf(Both(Session(world, 0, 25, "a"), Session(world, 25, 40, "b")));
  const CalibrationInformation alone = InformationOf(Session(world, 25, 40, "b"));
  const auto a = static_cast<size_t>(GroupOf(both, InformationGroup::Kind::kSession, "a"));
  ASSERT_EQ(both.parameters.size(), 4u * 7);
  ASSERT_EQ(alone.parameters.size(), both.parameters.size());
  for (size_t p = 0; p < both.parameters.size(); ++p) {
    const ParameterInformation& parameter = both.parameters[p];
    ASSERT_EQ(parameter.share.size(), both.groups.size());
    if (parameter.kind == Kind::kTimeOffset) continue;  // that of the first session
    const double ratio = parameter.sigma / alone.parameters[p].sigma;
    EXPECT_NEAR(parameter.share[a], 1 - ratio * ratio, 0.05)
        << parameter.camera << " " << parameter.name;
    EXPECT_GT(parameter.share[a], 0.2);
  }
}

// Of an even wave no tenth holds much, and the shares of all are about their part of the data.
TEST(ParameterInformation, SpansAndCamerasOfAnEvenWaveHoldTheirPart) {
  const CalibrationInformation information = InformationOf(Session(World(), 0, 40, "a"));
  int spans = 0;
  uint32_t instants = 0;
  for (size_t g = 0; g < information.groups.size(); ++g) {
    const InformationGroup& group = information.groups[g];
    EXPECT_NE(group.kind, InformationGroup::Kind::kSession);
    if (group.kind != InformationGroup::Kind::kSpan) continue;
    ++spans;
    instants += group.instant_count;
    EXPECT_NEAR(group.to_s - group.from_s, 4, 0.2);
    double sum = 0;
    for (const ParameterInformation& parameter : information.parameters) {
      EXPECT_LT(parameter.share[g], 0.7) << parameter.camera << " " << parameter.name;
      sum += parameter.share[g];
    }
    EXPECT_GT(sum / static_cast<double>(information.parameters.size()), 0.03);
  }
  EXPECT_EQ(spans, 10);
  EXPECT_GT(instants, 700u);
  for (const ParameterInformation& parameter : information.parameters) {
    const int own = GroupOf(information, InformationGroup::Kind::kCamera, parameter.camera);
    EXPECT_EQ(parameter.share[static_cast<size_t>(own)], -1);
    EXPECT_GT(parameter.sigma, 0);
  }
}

// sim_3 is seen for ten seconds, and only together with sim_1.
TEST(ParameterInformation, NamesTheSpanAndTheCameraThatACameraRestsOn) {
  const SimulatedWorld world = World();
  CalibrationInput input = Session(world, 0, 40, "a");
  for (CameraTrack& track : input.tracks) {
    if (track.camera.camera == "sim_3") Keep(&track, 0, 10);
    if (track.camera.camera == "sim_0" || track.camera.camera == "sim_2") Keep(&track, 10, 40);
  }
  const CalibrationInformation information = InformationOf(std::move(input));
  const auto of = [&](InformationGroup::Kind kind, const std::string& name) {
    return static_cast<size_t>(GroupOf(information, kind, name));
  };
  const size_t sim_1 = of(InformationGroup::Kind::kCamera, "sim_1");
  const size_t sim_2 = of(InformationGroup::Kind::kCamera, "sim_2");
  std::map<std::string, int> seen;
  for (const ParameterInformation& parameter : information.parameters) {
    if (parameter.kind != Kind::kPosition && parameter.kind != Kind::kRotation) continue;
    ++seen[parameter.camera];
    if (parameter.camera == "sim_3") {
      EXPECT_EQ(parameter.share[sim_1], 1) << parameter.name;
      EXPECT_LT(parameter.share[sim_2], 0.9) << parameter.name;
    } else if (parameter.camera == "sim_0") {
      // Without sim_1 the other two still hold each other.
      EXPECT_LT(parameter.share[sim_1], 1) << parameter.name;
    }
  }
  EXPECT_EQ(seen["sim_3"], 6);
}

}  // namespace
}  // namespace rigcal::server::parameter_information_test
