// SPDX-License-Identifier: Apache-2.0
// The life of a rig with a real server and the command line: a calibration becomes active, a camera
// is bumped, the monitor names it, it is repaired, and what must not become active does not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/simulation/world/simulated_world.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::rig_life_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kBumpRad = 0.4 * M_PI / 180;

constexpr int kRateHz = 15;

// One long wave, of which sessions are parts.
SimulatedWorld World() {
  SimulationOptions options;
  options.camera_count = 4;
  options.duration_s = 60;
  options.rate_hz = kRateHz;
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(options, target);
}

class RigLife : public ::testing::Test {
 protected:
  struct Recording {
    std::string id;
    int from_s = 0, to_s = 20;
    std::vector<std::string> bumped = {};  // turned by kBumpRad about their centres
    std::string cropped = {};              // camera with another image size
    std::string rig = "rig";
    std::vector<std::string> without = {};
    int floor_places =
        0;  // instead of a wave: the wand lies at so many places on z = 0 of the world
  };

  // A second at each place.
  static std::vector<WandPose> FloorPoses(int places) {
    std::vector<WandPose> poses;
    for (int i = 0; i < places; ++i) {
      const double angle = 2.2 * i;
      const Eigen::Vector3d direction(std::cos(angle + 1), std::sin(angle + 1), 0);
      poses.push_back({Eigen::Vector3d(std::cos(angle), std::sin(angle), 0), direction});
    }
    return poses;
  }

  static bool Has(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  }

  void Record(const Recording& recording) {
    const SimulatedWorld world = World();
    const std::vector<WandPose> floor = FloorPoses(recording.floor_places);
    const int first = kRateHz * recording.from_s;
    const int last =
        floor.empty() ? kRateHz * recording.to_s : first + kRateHz * recording.floor_places;
    v1::CreateSessionRequest request;
    request.set_id(recording.id);
    request.set_rig(recording.rig);
    *request.mutable_target() = wire::ToProto(world.target());
    for (const SimulatedCamera& camera : world.cameras()) {
      CameraDescription description = camera.description;
      if (Has(recording.without, description.camera)) continue;
      if (description.camera == recording.cropped) description.image_size_px.height += 8;
      *request.add_cameras() = wire::ToProto(description);
    }
    ASSERT_THAT(client_.CreateSession(request), IsOk());
    ASSERT_THAT(client_.StartSession(recording.id), IsOk());
    for (size_t c = 0; c < world.cameras().size(); ++c) {
      const std::string& name = world.cameras()[c].description.camera;
      if (Has(recording.without, name)) continue;
      const int camera = static_cast<int>(c);
      ObservationBatch batch;
      batch.stream.session_id = recording.id;
      batch.stream.camera = name;
      batch.marker_count = 3;
      for (int frame = first; frame < last; ++frame) {
        Observation row =
            floor.empty()
                ? world.Observe(camera, frame)
                : world.ObserveWand(camera, frame,
                                    floor[static_cast<size_t>((frame - first) / kRateHz)]);
        if (Has(recording.bumped, name)) Turn(world.cameras()[c].true_intrinsics, &row);
        batch.Append(row);
        if (batch.rows() < 200 && frame + 1 < last) continue;
        ASSERT_THAT(client_.Upload(batch), IsOk());
        const uint32_t next = batch.end_seq();
        batch = batch.Slice(0, 0);
        batch.first_seq = next;
      }
      ASSERT_THAT(client_.UploadEnd(recording.id, name, 1, static_cast<uint32_t>(last - first)),
                  IsOk());
    }
    ASSERT_THAT(client_.WaitUntilFinished(recording.id), IsOk());
  }

  static void Turn(const Intrinsics& intrinsics, Observation* row) {
    const Eigen::AngleAxisd turn(kBumpRad, Eigen::Vector3d(1, 1, 0.3).normalized());
    for (MarkerObservation& marker : row->markers) {
      if (!marker.visible) continue;
      const auto ray = Undistort(intrinsics, marker.centre_px);
      Eigen::Vector2d pixel;
      if (ray.ok() && Project(intrinsics, turn * ray->homogeneous(), &pixel)) {
        marker.centre_px = pixel;
      }
    }
  }

  CommandResult Rigcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    arguments.insert(arguments.end(), {"--server", server_.address()});
    return RunCommand(arguments);
  }
  // The id of a calibration that must succeed; 3 is a bad one.
  std::string Calibrate(const std::vector<std::string>& arguments) {
    std::vector<std::string> command = {"calibrate"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    command.insert(command.end(), {"--wait", "-o", "json"});
    const CommandResult result = Rigcal(command);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return result.exit_code == 0 ? json::parse(result.output)["id"].get<std::string>() : "";
  }
  std::string Active() {
    const CommandResult rig = Rigcal({"rig", "get", "rig", "-o", "json"});
    EXPECT_EQ(rig.exit_code, 0) << rig.error;
    return json::parse(rig.output)["active_calibration_id"];
  }
  void ExpectRefused(const std::vector<std::string>& arguments, const std::string& why) {
    const std::string before = Active();
    const CommandResult result = Rigcal(arguments);
    EXPECT_EQ(result.exit_code, 1) << result.output << result.error;
    EXPECT_THAT(result.error, HasSubstr(why));
    EXPECT_EQ(Active(), before);
  }

  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path(), 0, {}, {"--log-level", "debug"}};
  ServerClient client_{server_.address()};
};

TEST_F(RigLife, ABumpedCameraIsNamedRepairedAndRolledBack) {
  Record({.id = "first"});
  Record({.id = "quiet", .from_s = 20, .to_s = 30});
  Record({.id = "bumped", .from_s = 30, .to_s = 40, .bumped = {"sim_2"}});
  const std::string first = Calibrate({"first", "--activate", "--reason", "installed"});
  EXPECT_EQ(Active(), first);

  const CommandResult quiet = Rigcal({"monitor", "rig", "--session", "quiet"});
  EXPECT_EQ(quiet.exit_code, 0) << quiet.output << quiet.error;
  EXPECT_THAT(quiet.output, HasSubstr("no camera has moved"));

  const CommandResult moved = Rigcal({"monitor", "rig", "--session", "bumped"});
  EXPECT_EQ(moved.exit_code, 7) << moved.output << moved.error;
  EXPECT_THAT(moved.output, HasSubstr("sim_2 has moved; repair: rigcal calibrate bumped --only"));
  EXPECT_EQ(Active(), first);

  const CommandResult automatic = Rigcal({"monitor", "rig", "--session", "bumped", "--auto"});
  EXPECT_EQ(automatic.exit_code, 0) << automatic.output << automatic.error;
  const std::string repaired = Active();
  EXPECT_NE(repaired, first);
  const json calibration =
      json::parse(Rigcal({"calibration", "get", repaired, "-o", "json"}).output);
  EXPECT_EQ(calibration["options"]["parent_id"], first);
  EXPECT_EQ(calibration["options"]["only_cameras"], json({"sim_2"}));
  EXPECT_THAT(calibration["held"].dump(), HasSubstr("pose of sim_0"));
  EXPECT_THAT(calibration["held"].dump(), Not(HasSubstr("pose of sim_2")));

  const json difference =
      json::parse(Rigcal({"calibration", "diff", first, repaired, "-o", "json"}).output);
  EXPECT_EQ(difference["frame_cameras"], json({"sim_0", "sim_1", "sim_3"}));
  for (const json& camera : difference["cameras"]) {
    if (camera["camera"] == "sim_2") {
      EXPECT_EQ(camera["verdict"], "VERDICT_MOVED");
      EXPECT_NEAR(camera["rotation_rad"].get<double>(), kBumpRad,
                  6 * camera["rotation_sigma_rad"].get<double>());
      EXPECT_LT(camera["translation_m"].get<double>(),
                6 * camera["translation_sigma_m"].get<double>());
    } else {
      EXPECT_EQ(camera["verdict"], "VERDICT_SAME");
      EXPECT_LT(camera["translation_m"].get<double>(), 1e-9);
    }
  }

  EXPECT_EQ(Rigcal({"rig", "rollback", "rig", "--reason", "put back"}).exit_code, 0);
  EXPECT_EQ(Active(), first);
  ExpectRefused({"rig", "rollback", "rig"}, "no calibration was active before");
  const json history = json::parse(Rigcal({"rig", "history", "rig", "-o", "json"}).output);
  ASSERT_EQ(history["activations"].size(), 3u);
  EXPECT_EQ(history["activations"][0]["reason"], "put back");
  EXPECT_TRUE(history["activations"][0]["rollback"]);
  EXPECT_EQ(history["activations"][2]["reason"], "installed");
}

double Height(const json& calibration, const std::string& name) {
  for (const json& camera : calibration["cameras"]) {
    if (camera["camera"] != name) continue;
    const json &q = camera["cam_from_rig"]["rotation"],
               &t = camera["cam_from_rig"]["translation_m"];
    const auto at = [](const json& from, const char* key) { return from.value(key, 0.0); };
    const RigidTransform pose(Eigen::Quaterniond(at(q, "w"), at(q, "x"), at(q, "y"), at(q, "z")),
                              Eigen::Vector3d(at(t, "x"), at(t, "y"), at(t, "z")));
    return pose.SourceFromTargetTranslation().z();
  }
  ADD_FAILURE() << "no camera " << name;
  return 0;
}

TEST_F(RigLife, AFloorIsSetKeptAndRolledBack) {
  const SimulatedWorld world = World();
  Record({.id = "first"});
  Record({.id = "floor", .from_s = 50, .floor_places = 3});
  Record({.id = "line", .from_s = 55, .floor_places = 1});
  Record({.id = "later", .from_s = 20, .to_s = 40, .bumped = {"sim_2"}});
  const std::string first = Calibrate({"first", "--activate"});

  // Weak and contradicting sources change nothing.
  ExpectRefused({"rig", "origin", "rig", "--on-floor", "--session", "line", "--activate"},
                "points on the floor are on one line: they spread");
  ExpectRefused({"calibration", "origin", first, "--on-floor", "--session", "first"},
                "rests nowhere");
  ExpectRefused({"rig", "scale", "rig", "--distance", "sim_0,sim_9,4"}, "no camera sim_9");
  const auto centre = [&world](size_t camera) {
    return world.cameras()[camera].cam_from_rig.SourceFromTargetTranslation();
  };
  const double true_m = (centre(0) - centre(1)).norm();
  ExpectRefused({"rig", "scale", "rig", "--distance",
                 absl::StrCat("sim_0,sim_1,", 1.03 * true_m, ",0.002"), "--activate"},
                "disagree");

  const CommandResult set = Rigcal({"rig", "origin", "rig", "--on-floor", "--session", "floor",
                                    "--activate", "--reason", "the floor", "-o", "json"});
  ASSERT_EQ(set.exit_code, 0) << set.error;
  const json floor = json::parse(set.output);
  const std::string floor_id = floor["id"];
  EXPECT_EQ(Active(), floor_id);
  EXPECT_EQ(floor["options"]["parent_id"], first);
  EXPECT_EQ(floor["reason"], "the floor");
  EXPECT_EQ(floor["frame"]["source"], "FRAME_SOURCE_FLOOR");
  EXPECT_EQ(floor["frame"]["residuals"].size(), 9u);
  EXPECT_EQ(floor["reference_camera"], "");
  for (size_t c = 0; c < world.cameras().size(); ++c) {
    EXPECT_NEAR(Height(floor, world.cameras()[c].description.camera), centre(c).z(), 0.01);
  }
  const json difference =
      json::parse(Rigcal({"calibration", "diff", first, floor_id, "-o", "json"}).output);
  EXPECT_EQ(difference["frame_cameras"].size(), 4u);

  // Rows of a folder give the same.
  const auto folder = directory_.path() / "rows";
  std::filesystem::create_directory(folder);
  for (size_t c = 0; c < world.cameras().size(); ++c) {
    std::ofstream csv(folder / (world.cameras()[c].description.camera + ".csv"));
    csv.precision(17);
    for (int i = 0; i < 3 * kRateHz; ++i) {
      const Observation row = world.ObserveWand(static_cast<int>(c), 50 * kRateHz + i,
                                                FloorPoses(3)[static_cast<size_t>(i / kRateHz)]);
      csv << row.time_ns;
      for (const MarkerObservation& marker : row.markers) {
        csv << ";";
        if (marker.visible) csv << marker.centre_px.x();
        csv << ";";
        if (marker.visible) csv << marker.centre_px.y();
      }
      csv << "\n";
    }
  }
  const CommandResult by_folder =
      Rigcal({"calibration", "origin", first, "--floor", folder.string(), "-o", "json"});
  ASSERT_EQ(by_folder.exit_code, 0) << by_folder.error;
  const json of_folder = json::parse(by_folder.output);
  EXPECT_NEAR(Height(of_folder, "sim_0"), Height(floor, "sim_0"), 1e-3);
  EXPECT_EQ(of_folder["options"]["origin"]["measured"].size(), 0u);

  // A repair, a refinement and a new solve end in the frame of the floor.
  const std::string repaired = Calibrate({"later", "--only", "sim_2"});
  const json repair = json::parse(Rigcal({"calibration", "get", repaired, "-o", "json"}).output);
  EXPECT_EQ(Height(repair, "sim_0"), Height(floor, "sim_0"));
  EXPECT_EQ(repair["frame"]["source"], "FRAME_SOURCE_KEPT");
  EXPECT_EQ(repair["reference_camera"], "");
  const CommandResult anew =
      Rigcal({"calibrate", "later", "--activate", "--reason", "anew", "-o", "json"});
  ASSERT_EQ(anew.exit_code, 0) << anew.error;
  const json kept = json::parse(anew.output);
  EXPECT_EQ(kept["frame"]["source"], "FRAME_SOURCE_KEPT");
  EXPECT_EQ(kept["frame"]["calibration_id"], floor_id);
  EXPECT_EQ(kept["frame"]["cameras"], json({"sim_0", "sim_1", "sim_3"}));
  for (const char* name : {"sim_0", "sim_1", "sim_3"}) {
    EXPECT_NEAR(Height(kept, name), Height(floor, name), 0.01) << name;
  }
  const std::string own = Calibrate({"later", "--own-frame"});
  EXPECT_FALSE(
      json::parse(Rigcal({"calibration", "get", own, "-o", "json"}).output).contains("frame"));

  // The true distance is one more source of the scale.
  const CommandResult scaled =
      Rigcal({"calibration", "scale", floor_id, "--distance",
              absl::StrCat("sim_0,sim_1,", true_m, ",0.002"), "-o", "json"});
  ASSERT_EQ(scaled.exit_code, 0) << scaled.error;
  const json scale = json::parse(scaled.output);
  EXPECT_EQ(scale["scale"]["sources"].size(), 2u);
  EXPECT_LT(scale["scale"]["sigma_rel"].get<double>(),
            floor["target"]["scale_sigma_rel"].get<double>());
  EXPECT_EQ(scale["frame"]["source"], "FRAME_SOURCE_KEPT");

  // What holds it is kept by what derives from it.
  const CommandResult explained = Rigcal({"calibration", "explain", scale["id"]});
  EXPECT_EQ(explained.exit_code, 0) << explained.error;
  EXPECT_THAT(explained.output, HasSubstr("of the solve of " + first));
  EXPECT_THAT(explained.output, HasSubstr("position along z"));

  EXPECT_EQ(Rigcal({"rig", "rollback", "rig"}).exit_code, 0);
  EXPECT_EQ(Active(), floor_id);
  EXPECT_EQ(Rigcal({"rig", "rollback", "rig"}).exit_code, 0);
  EXPECT_EQ(Active(), first);
}

// The monitor as a mode of the server: nobody asks it about a session.
TEST_F(RigLife, TheServersMonitorNamesAndRepairs) {
  const auto live = [&] {
    const CommandResult shown = Rigcal({"monitor", "rig", "-o", "json"});
    return std::pair(shown.exit_code, json::parse(shown.output));
  };
  const auto await_look = [&](const std::string& session) {
    return WaitFor([&] {
      const json monitor = live().second;
      return monitor.value("session_id", "") == session && monitor.contains("time");
    });
  };
  const auto cameras_with = [&](const char* verdict) {
    std::vector<std::string> names;
    const json monitor = live().second;
    for (const json& camera : monitor["cameras"]) {
      if (camera["verdict"] == verdict) names.push_back(camera["camera"]);
    }
    return names;
  };
  Record({.id = "first"});
  EXPECT_EQ(live().second.value("mode", "MONITOR_MODE_UNSPECIFIED"), "MONITOR_MODE_UNSPECIFIED");
  const std::string first = Calibrate({"first", "--activate"});
  ASSERT_EQ(Rigcal({"rig", "monitor", "rig", "watch"}).exit_code, 0);
  EXPECT_THAT(Rigcal({"rig", "get", "rig"}).output, HasSubstr("monitor            watch"));
  ASSERT_TRUE(WaitFor([&] { return live().second.value("calibration_id", "") == first; }));

  Record({.id = "quiet", .from_s = 20, .to_s = 30});
  ASSERT_TRUE(await_look("quiet"));
  EXPECT_EQ(cameras_with("VERDICT_GOOD").size(), 4u) << live().second.dump(2);
  EXPECT_EQ(live().first, 0);

  Record({.id = "bumped", .from_s = 30, .to_s = 40, .bumped = {"sim_2"}});
  ASSERT_TRUE(await_look("bumped"));
  EXPECT_EQ(cameras_with("VERDICT_MOVED"), std::vector<std::string>{"sim_2"});
  EXPECT_EQ(cameras_with("VERDICT_GOOD").size(), 3u);
  EXPECT_EQ(live().first, 7);
  EXPECT_EQ(Active(), first);
  // Everybody who watches sees it.
  ASSERT_TRUE(WaitFor([&] {
    const CommandResult watched = Rigcal({"watch", "--session", "bumped"});
    return watched.output.find("warning camera_moved sim_2") != std::string::npos &&
           watched.output.find("moved: sim_2") != std::string::npos;
  }));

  ASSERT_EQ(Rigcal({"rig", "monitor", "rig", "repair"}).exit_code, 0);
  Record({.id = "again", .from_s = 40, .to_s = 50, .bumped = {"sim_2"}});
  ASSERT_TRUE(WaitFor([&] { return live().second.value("repair", "") == "REPAIR_STATE_ACTIVE"; }))
      << live().second.dump(2) << server_.process().StandardError();
  const std::string repaired = Active();
  EXPECT_NE(repaired, first);
  EXPECT_EQ(live().second["repair_id"], repaired);
  const json history = json::parse(Rigcal({"rig", "history", "rig", "-o", "json"}).output);
  EXPECT_EQ(history["activations"][0]["operator_name"], "monitor");
  EXPECT_EQ(history["activations"][0]["reason"], "monitor: sim_2 has moved");
  const json calibration =
      json::parse(Rigcal({"calibration", "get", repaired, "-o", "json"}).output);
  EXPECT_EQ(calibration["options"]["parent_id"], first);
  EXPECT_EQ(calibration["options"]["only_cameras"], json({"sim_2"}));

  Record({.id = "after", .from_s = 50, .to_s = 60, .bumped = {"sim_2"}});
  ASSERT_TRUE(await_look("after"));
  EXPECT_EQ(cameras_with("VERDICT_GOOD").size(), 4u) << live().second.dump(2);
  EXPECT_EQ(Active(), repaired);
  ASSERT_EQ(Rigcal({"rig", "monitor", "rig", "off"}).exit_code, 0);
  EXPECT_TRUE(WaitFor([&] { return live().second.value("mode", "") == "MONITOR_MODE_OFF"; }));
}

TEST_F(RigLife, WhatMustNotBecomeActiveDoesNot) {
  Record({.id = "first"});
  Record({.id = "fewer", .to_s = 12, .without = {"sim_3"}});
  Record({.id = "other", .to_s = 12, .rig = "other"});
  Record({.id = "two", .from_s = 30, .to_s = 40, .bumped = {"sim_1", "sim_2"}});
  Record({.id = "cropped", .from_s = 40, .to_s = 50, .cropped = "sim_2"});
  const std::string first = Calibrate({"first", "--activate"});
  ASSERT_EQ(Active(), first);

  // A calibration of other cameras, unless it is forced.
  const std::string fewer = Calibrate({"fewer"});
  ExpectRefused({"rig", "activate", fewer}, "without sim_3");
  ASSERT_EQ(Rigcal({"rig", "activate", fewer, "--force"}).exit_code, 0);
  ExpectRefused({"rig", "rollback", "rig"}, "with sim_3");
  ASSERT_EQ(Rigcal({"rig", "rollback", "rig", "--force"}).exit_code, 0);
  ASSERT_EQ(Active(), first);
  ExpectRefused({"calibration", "delete", first, "--yes"}, "it is the active one");

  // A what-if, by its options.
  const std::string what_if = Calibrate({"first", "--without", "sim_3", "--from", "2s", "--to",
                                         "18s", "--assume", "wand=0,0.1301,0.39"});
  ExpectRefused({"rig", "activate", what_if}, "it is a what-if");
  const CommandResult shown =
      Rigcal({"calibrate", "first", "--assume", "wand=0,0.1313,0.3939", "--wait"});
  EXPECT_THAT(shown.output, HasSubstr("against " + first));

  // A repair where another camera moved too, or with another image size.
  ExpectRefused({"calibrate", "two", "--only", "sim_2", "--activate"},
                "others have moved against calibration " + first + ", too: sim_1 by ");
  ExpectRefused({"calibrate", "cropped", "--only", "sim_1", "--activate"},
                "camera sim_2: its intrinsics in calibration " + first + " are for images of ");
  ExpectRefused({"calibrate", "cropped", "--prior", first, "--wait"},
                "camera sim_2: its intrinsics");
  ExpectRefused({"calibrate", "other", "--only", "sim_1", "--parent", first, "--wait"},
                "it is of rig 'rig'");
  ExpectRefused({"calibrate", "other", "--only", "sim_1", "--wait"}, "has no active calibration");
  ExpectRefused({"calibrate", "fewer", "--only", "sim_1", "--wait"}, "sim_3 of calibration");
  ExpectRefused({"calibrate", "first", "--only", "sim_9", "--wait"}, "'sim_9' is in none");
  ExpectRefused({"rig", "activate", "c-000404"}, "c-000404");
  ExpectRefused({"rig", "get", "nobody"}, "no rig 'nobody'");
}

TEST_F(RigLife, PruneKeepsWhatACalibrationUsed) {
  Record({.id = "used", .to_s = 12});
  Record({.id = "unused", .from_s = 20, .to_s = 24});
  Calibrate({"used"});
  EXPECT_EQ(Rigcal({"session", "prune"}).exit_code, 2);
  const auto prune = [&](std::vector<std::string> more) {
    std::vector<std::string> command = {"session", "prune", "--max-size", "1", "-o", "json"};
    command.insert(command.end(), more.begin(), more.end());
    const CommandResult result = Rigcal(command);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return json::parse(result.output);
  };
  // Both are recent.
  EXPECT_EQ(json::parse(
                Rigcal({"session", "prune", "--older-than", "1", "-o", "json"}).output)["sessions"]
                .size(),
            0u);
  const json old = json::parse(
      Rigcal({"session", "prune", "--older-than", "0.0001", "--dry-run", "-o", "json"}).output);
  EXPECT_LE(old["sessions"].size(), 2u);
  ASSERT_TRUE(WaitFor([&] {
    return json::parse(
               Rigcal({"session", "prune", "--older-than", "0.0001", "--dry-run", "-o", "json"})
                   .output)["sessions"]
               .size() == 2;
  }));
  const CommandResult pruned = Rigcal({"session", "prune", "--older-than", "0.0001", "-o", "json"});
  ASSERT_EQ(pruned.exit_code, 0) << pruned.error;
  const json sessions = json::parse(pruned.output)["sessions"];
  ASSERT_EQ(sessions.size(), 2u);
  EXPECT_EQ(sessions[0]["id"], "used");
  EXPECT_EQ(sessions[0]["kept"], "a calibration was made from it");
  EXPECT_EQ(sessions[1]["kept"], "");
  const CommandResult again = Rigcal({"calibrate", "unused", "--wait"});
  EXPECT_THAT(again.error, HasSubstr("were deleted"));
  // Told so, the rest goes, too.
  EXPECT_EQ(prune({"--include-calibrated", "--older-than", "0.0001"})["sessions"].size(), 1u);
  EXPECT_THAT(Rigcal({"calibrate", "used", "--wait"}).error, HasSubstr("were deleted"));
}

}  // namespace
}  // namespace rigcal::testing::rig_life_test
