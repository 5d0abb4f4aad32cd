// SPDX-License-Identifier: Apache-2.0
#include "server/solve/observation_digest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <string>

#include "server/associate/clean_track.h"
#include "tests/server/associate/edit_rows.h"

namespace rigcal::server::observation_digest_test {
namespace {

// Everything a digest is made from.
struct Made {
  CalibrationOptions options;
  Target target;
  std::vector<AlignedTrack> tracks;
  std::vector<std::vector<bool>> used;

  std::string Digest() const { return ObservationDigest(options, target, tracks, used); }
};

Observation Row(int64_t time_ns) {
  Observation row;
  row.time_ns = time_ns;
  row.markers.resize(2);
  for (MarkerObservation& marker : row.markers) {
    marker.visible = true;
    marker.centre_px = {100 + 1e-7 * static_cast<double>(time_ns), 200};
    marker.covariance_px2 << 0.3, 0.1, 0.1, 0.4;
  }
  return row;
}

Made Example() {
  Made made;
  made.target.marker_positions_m = {0, 0.4};
  made.target.blink_hz = {500};
  for (const char* name : {"a", "b"}) {
    AlignedTrack track;
    track.track.session_id = "s-1";
    track.track.camera.camera = name;
    track.track.camera.clock.clock_id = name;
    track.track.camera.intrinsics =
        Intrinsics{DistortionModel::kBrownConrady, 900, 901, 640, 400, {0.1, 0, 0, 0, 0}};
    for (int i = 0; i < 3; ++i) track.track.observations.push_back(Row(i * 40'000'000));
    made.tracks.push_back(track);
    made.used.push_back({true, true, false});
  }
  return made;
}

void Row0(Made& made, const std::function<void(Observation&)>& edit) {
  EditRow(&made.tracks[1], 0, edit);
}
void Marker(Made& made, const std::function<void(MarkerObservation&)>& edit) {
  Row0(made, [&edit](Observation& row) { edit(row.markers[1]); });
}
CameraDescription& Camera(Made& made) { return made.tracks[1].track.camera; }

TEST(ObservationDigest, Is64HexadecimalDigits) {
  const std::string digest = Example().Digest();
  EXPECT_EQ(digest.size(), 64u);
  EXPECT_EQ(digest.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_EQ(digest, Example().Digest());
  EXPECT_EQ(ObservationDigest({}, {}, {}, {}).size(), 64u);
}

TEST(ObservationDigest, ChangesWithEveryValueThatIsUsed) {
  const std::map<std::string, std::function<void(Made&)>> changes = {
      {"time", [](Made& m) { Row0(m, [](auto& row) { row.time_ns += 1; }); }},
      {"visible", [](Made& m) { Marker(m, [](auto& marker) { marker.visible = false; }); }},
      {"x", [](Made& m) { Marker(m, [](auto& marker) { marker.centre_px.x() += 1e-9; }); }},
      {"y", [](Made& m) { Marker(m, [](auto& marker) { marker.centre_px.y() += 1e-9; }); }},
      {"cov_xx",
       [](Made& m) { Marker(m, [](auto& marker) { marker.covariance_px2(0, 0) += 1e-9; }); }},
      {"cov_xy",
       [](Made& m) { Marker(m, [](auto& marker) { marker.covariance_px2(0, 1) += 1e-9; }); }},
      {"cov_yy",
       [](Made& m) { Marker(m, [](auto& marker) { marker.covariance_px2(1, 1) += 1e-9; }); }},
      {"time_delta", [](Made& m) { Marker(m, [](auto& marker) { marker.time_delta_ns = -1; }); }},
      {"label_confidence",
       [](Made& m) { Marker(m, [](auto& marker) { marker.label_confidence = 0.99f; }); }},
      {"centre_kind",
       [](Made& m) {
         Marker(m, [](auto& marker) { marker.centre_kind = CentreKind::kSphereCentre; });
       }},
      {"markers swapped",
       [](Made& m) {
         Row0(m, [](Observation& row) {
           row.markers[0].centre_px.x() += 1;
           std::swap(row.markers[0], row.markers[1]);
         });
       }},
      {"a row fewer", [](Made& m) { m.used[1][1] = false; }},
      {"a row more", [](Made& m) { m.used[1][2] = true; }},
      {"another camera's row",
       [](Made& m) {
         m.used = {{true, true, true}, {true, false, false}};
       }},
      {"camera", [](Made& m) { Camera(m).camera = "c"; }},
      {"clock_id", [](Made& m) { Camera(m).clock.clock_id = "a"; }},
      {"clock_epoch", [](Made& m) { m.tracks[1].track.clock_epoch = 1; }},
      {"clock_offset", [](Made& m) { m.tracks[1].clock_offset_ns = 1; }},
      {"latency", [](Made& m) { Camera(m).latency_s = 1e-6; }},
      {"model", [](Made& m) { Camera(m).intrinsics->model = DistortionModel::kRational; }},
      {"fx", [](Made& m) { Camera(m).intrinsics->fx_px += 1e-9; }},
      {"fy", [](Made& m) { Camera(m).intrinsics->fy_px += 1e-9; }},
      {"cx", [](Made& m) { Camera(m).intrinsics->cx_px += 1e-9; }},
      {"cy", [](Made& m) { Camera(m).intrinsics->cy_px += 1e-9; }},
      {"k3", [](Made& m) { Camera(m).intrinsics->distortion[4] = 1e-9; }},
      {"spacing", [](Made& m) { m.target.marker_positions_m[1] += 1e-9; }},
      {"diameter", [](Made& m) { m.target.diameter_m = 0.04; }},
      {"blink",
       [](Made& m) {
         m.target.blink_hz = {500, 500};
       }},
      {"tolerance", [](Made& m) { m.target.span_tolerance_m = 0.001; }},
      {"target kind", [](Made& m) { m.target.kind = TargetKind::kPoint; }},
      {"reference", [](Made& m) { m.options.reference_camera = "b"; }},
      {"intrinsics", [](Made& m) { m.options.intrinsics = Estimate::kFixed; }},
      {"time_offsets", [](Made& m) { m.options.time_offsets = Estimate::kFixed; }},
      {"marker_positions", [](Made& m) { m.options.marker_positions = Estimate::kFixed; }},
      {"sigma", [](Made& m) { m.options.sigma_px = 1; }},
      {"association", [](Made& m) { m.options.association_tolerance_s = 0.01; }},
      {"seed", [](Made& m) { m.options.seed = 1; }},
  };
  std::map<std::string, std::string> seen = {{Example().Digest(), "nothing"}};
  for (const auto& [what, change] : changes) {
    Made made = Example();
    change(made);
    const auto [entry, inserted] = seen.insert({made.Digest(), what});
    EXPECT_TRUE(inserted) << what << " gives the digest of " << entry->second;
  }
}

TEST(ObservationDigest, DoesNotChangeWithRowsThatAreNotUsed) {
  Made made = Example();
  EditRow(&made.tracks[0], 2, [](Observation& row) { row.markers[0].centre_px.x() = 5; });
  made.tracks[1].track.observations.push_back(Row(500'000'000));
  made.used[1].push_back(false);
  EXPECT_EQ(made.Digest(), Example().Digest());
}

TEST(ObservationDigest, DoesNotChangeWithWhatAnInvisibleMarkerHolds) {
  Made made = Example(), other = Example();
  Marker(made, [](MarkerObservation& marker) { marker.visible = false; });
  Marker(other, [](MarkerObservation& marker) {
    marker.visible = false;
    marker.centre_px = {77, 88};
    marker.time_delta_ns = 5;
  });
  EXPECT_EQ(made.Digest(), other.Digest());
}

TEST(ObservationDigest, DoesNotChangeWithTheSessionsId) {
  Made made = Example();
  for (AlignedTrack& track : made.tracks) track.track.session_id = "another";
  EXPECT_EQ(made.Digest(), Example().Digest());
  // But with which tracks share a session.
  made.tracks[1].track.session_id = "third";
  EXPECT_NE(made.Digest(), Example().Digest());
}

TEST(ObservationDigest, DoesNotChangeWithTheOrderOfArrival) {
  std::vector<CameraTrack> arrived;
  for (const AlignedTrack& track : Example().tracks) {
    const ObservationTable& table = track.track.observations;
    std::vector<Observation> rows;
    for (const Observation& row : table) rows.push_back(row);
    arrived.push_back({track.track.session_id, track.track.camera, std::move(rows), {}, {}});
  }
  std::mt19937 random(3);
  std::set<std::string> digests;
  for (int round = 0; round < 6; ++round) {
    for (CameraTrack& track : arrived) {
      std::shuffle(track.observations.begin(), track.observations.end(), random);
    }
    std::shuffle(arrived.begin(), arrived.end(), random);
    RefusalCounter refused;
    Made made = Example();
    made.tracks.clear();
    std::vector<CameraTrack> rows = arrived;
    for (CleanTrack& track : CleanTracks(&rows, 2, &refused)) {
      made.tracks.emplace_back().track = std::move(track);
    }
    EXPECT_TRUE(refused.empty());
    digests.insert(made.Digest());
  }
  EXPECT_EQ(digests, std::set<std::string>{Example().Digest()});
}

}  // namespace
}  // namespace rigcal::server::observation_digest_test
