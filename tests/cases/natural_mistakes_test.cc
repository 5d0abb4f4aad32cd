// SPDX-License-Identifier: Apache-2.0
// What people type by mistake, and what every program answers: none of it is accepted in silence,
// and the last line says what is wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "common/simulation/world/simulation_options.h"
#include "tests/testing/process.h"
#include "tests/testing/recorded_rig.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::natural_mistakes_test {
namespace {

using ::testing::HasSubstr;

namespace fs = std::filesystem;

// {dir} is a folder of the test, {host} a running server, {http} its other port.
struct Mistake {
  std::vector<std::string> command;
  int exit_code = 0;
  std::string last_line;  // a part of it
};

constexpr char kWand[] = "wand:0,0.13,0.39";

// In {dir}: rig (three cameras), empty (a folder), notes.txt, picture.png (which is none), no lens
// in "lensless", one camera in "single".
class NaturalMistakes : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = std::make_unique<TemporaryDirectory>();
    SimulationOptions simulation;
    simulation.camera_count = 3;
    simulation.duration_s = 10;
    const fs::path dir = directory_->path();
    WriteRecordedRig(simulation, dir / "rig");
    WriteRecordedRig(simulation, dir / "lensless");
    WriteRecordedRig(simulation, dir / "single");
    bool first = true;
    for (const auto& entry : fs::directory_iterator(dir / "rig")) {
      if (entry.path().extension() != ".csv") continue;
      const std::string stem = entry.path().stem().string();
      fs::remove(dir / "lensless" / (stem + ".yaml"));
      if (!first) {
        fs::remove(dir / "single" / (stem + ".yaml"));
        fs::remove(dir / "single" / (stem + ".csv"));
      }
      first = false;
    }
    fs::create_directories(dir / "empty");
    directory_->WriteFile("notes.txt", "buy batteries\n");
    directory_->WriteFile("picture.png", "this is no picture\n");
    directory_->WriteFile("there.csv", "of somebody\n");
    directory_->WriteFile("taken.csv", "of somebody\n");
    directory_->WriteFile("multical.json",
                          R"({"cameras": {"left": {"model": "standard", "image_size": [640, 480],
                              "K": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "dist": [0, 0, 0, 0]}},
                              "camera_poses": {"left": {"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
                              "T": [0, 0, 0]}}})");

    server_ = std::make_unique<ServerProcess>(
        dir / "store", 0, std::map<std::string, std::string>{},
        std::vector<std::string>{"--http-port-file", (dir / "http").string()});
    std::vector<std::unique_ptr<Process>> agents;
    for (int i = 0; i < 3; ++i) {
      agents.push_back(std::make_unique<Process>(Process::Options{
          {"rigcal-agent", "--server", server_->address(), "--agent-id", absl::StrCat("pc-", i),
           "--state-dir", (dir / absl::StrCat("agent", i)).string(), "--source",
           absl::StrCat("sim:camera=", i, ";cameras=3;duration=20;speed=max")},
          {}}));
    }
    ServerClient client(server_->address());
    ASSERT_TRUE(WaitFor([&] {
      const auto list = client.ListAgents();
      return list.ok() && list->size() == 3;
    }));
    ASSERT_EQ(Run({"rigcal", "session", "create", "--target", kWand, "--id", "wave", "--start"})
                  .exit_code,
              0);
    ASSERT_THAT(client.WaitUntilFinished("wave"), IsOk());
    const CommandResult calibrated = Run({"rigcal", "calibrate", "wave", "--wait"});
    ASSERT_EQ(calibrated.exit_code, 0) << calibrated.error;
  }
  static void TearDownTestSuite() {
    server_.reset();
    directory_.reset();
  }

  static CommandResult Run(std::vector<std::string> command) {
    for (std::string& word : command) word = Filled(word);
    return RunCommand(command, {{"RIGCAL_SERVER", server_->address()},
                                {"HOME", directory_->path().string()},
                                {"XDG_CONFIG_HOME", (directory_->path() / "config").string()}});
  }
  static std::string Filled(const std::string& text) {
    std::string http;
    std::getline(std::ifstream(directory_->path() / "http") >> std::ws, http);
    return absl::StrReplaceAll(text, {{"{dir}", directory_->path().string()},
                                      {"{host}", server_->address()},
                                      {"{http}", "127.0.0.1:" + http}});
  }
  static void Expect(const std::vector<Mistake>& mistakes) {
    for (const Mistake& mistake : mistakes) {
      const CommandResult result = Run(mistake.command);
      const std::string line = absl::StrJoin(mistake.command, " ");
      EXPECT_EQ(result.exit_code, mistake.exit_code) << line << "\n" << result.error;
      const std::string error(absl::StripTrailingAsciiWhitespace(result.error));
      const size_t last = error.rfind('\n');
      EXPECT_THAT(last == std::string::npos ? error : error.substr(last + 1),
                  HasSubstr(Filled(mistake.last_line)))
          << line << "\n"
          << error;
    }
  }

  static std::unique_ptr<TemporaryDirectory> directory_;
  static std::unique_ptr<ServerProcess> server_;
};

std::unique_ptr<TemporaryDirectory> NaturalMistakes::directory_;
std::unique_ptr<ServerProcess> NaturalMistakes::server_;

std::vector<std::string> Create(const std::string& target) {
  return {"rigcal", "session", "create", "--target", target, "--id", "never"};
}

TEST_F(NaturalMistakes, UnitsOfTheWand) {
  Expect({
      {Create("wand:0,130,390"), 2, "metres"},
      {Create("wand:0,13,39"), 2, "metres"},
      {Create("wand:0,0.13,0.39;diameter=40"), 2, "diameter"},
      {Create("wand:0,0.13,0.39;diameter=4"), 2, "diameter"},
      {Create("wand:0, 0.13, 0.39;diameter=40mm"), 2, "40mm"},
      {Create("wand:0mm,130mm,390mm"), 2, "mm"},
      {Create("wand:0.39,0.13,0"), 2, "wand:0,0.13,0.39"},
      {Create("wand:0,5,15"), 2, "centimetres"},
      {Create("wand:0;0,13;0,39"), 2, "decimal"},
      {Create("wand:0,0,13,0,39"), 2, "decimal"},
      {Create("wand:0"), 2, "wand:0"},
      {Create("0,0.13,0.39"), 2, "wand:"},
      {Create("wand 0,0.13,0.39"), 2, "wand"},
      {Create("wand:0,0.13,0.39;tolerance=2"), 2, "tolerance"},
      {Create("wand:0,0.13,0.39;diamter=0.04"), 2, "diameter"},
      {Create("rigid:{dir}/nowhere.txt"), 2, "nowhere.txt"},
      {Create("rigid:{dir}/notes.txt"), 2, "notes.txt"},
      {{"rigcal", "calibrate", "wave", "--distance", "sim_0,sim_1,2500mm"}, 2, "2500mm"},
      {{"rigcal", "calibrate", "wave", "--distance", "2.5,sim_0,sim_1"}, 2, "sim_1"},
  });
}

TEST_F(NaturalMistakes, NamesOfCommandsAndOptions) {
  Expect({
      {{"rigcal", "sesion", "list"}, 2, "did you mean 'rigcal session'?"},
      {{"rigcal", "session", "lst"}, 2, "did you mean 'rigcal session list'?"},
      {{"rigcal", "list"}, 2, "rigcal session list"},
      {{"rigcal", "export", "c-000001"}, 2, "rigcal calibration export"},
      {{"rigcal", "list", "session"}, 2, "rigcal session list"},
      {{"rigcal", "session", "create", "--taget", kWand}, 2, "did you mean --target?"},
      {{"rigcal", "session", "create", "-target", kWand}, 2, "it is --target"},
      {{"rigcal", "session", "create", "--wand", kWand}, 2, "'--wand'"},
      {{"rigcal", "local", "{dir}/rig", "--target", kWand}, 2, "did you mean --data {dir}/rig?"},
      {{"rigcal", "calibration", "gett", "c-000001"}, 2, "did you mean 'rigcal calibration get'?"},
      {{"rigcal", "calibration", "ls"}, 2, "did you mean 'rigcal calibration list'?"},
      {{"rigcal", "calibrate", "wave", "--accept", "2"}, 2, "did you mean --accept-mm?"},
      {{"rigcal", "calibrate", "wave", "--checkerboard", "9x6"}, 2, "'--checkerboard'"},
      {{"rigcal", "calibrate", "wave", "--verbose"}, 2, "'--verbose'"},
      {{"rigcal", "calibrate", "wave", "-v"}, 2, "'-v'"},
      {{"rigcal", "agent", "preview", "sim_0", "--out", "now.jpg"}, 2, "it is --output now"},
      {{"rigcal-agent", "detct", "{dir}/rig"}, 2, "did you mean 'rigcal-agent detect'?"},
      {{"rigcal-agent", "--sorce", "sim:camera=0"}, 2, "did you mean --source?"},
      {{"rigcal-agent", "info", "{dir}/notes.txt", "--output", "json"}, 2, "--output-format"},
      {{"rigcal-agent", "detect", "{dir}/empty", "--target", kWand, "--output", "json"},
       2,
       "--output-format json"},
      {{"rigcal-server", "chek"}, 2, "did you mean 'rigcal-server check'?"},
      {{"rigcal-server", "--lisen", "0.0.0.0"}, 2, "did you mean --listen?"},
      {{"rigcal-server", "--port", "7500"}, 2, "'--port'"},
      {{"rigcal-worker", "--memry", "5"}, 2, "did you mean --memory?"},
  });
}

TEST_F(NaturalMistakes, IdsAndNames) {
  Expect({
      {{"rigcal", "session", "get", "nope"}, 1, "no session nope; there is wave"},
      {{"rigcal", "session", "get", "wav"}, 1, "the beginning of wave"},
      {{"rigcal", "session", "get", "wvae"}, 1, "did you mean wave?"},
      {{"rigcal", "session", "get", "latest"}, 1, "the newest one is wave"},
      {{"rigcal", "session", "get", "c-000001"}, 1, "rigcal calibration get c-000001"},
      {{"rigcal", "calibration", "get", "wave"}, 1, "rigcal session get wave"},
      {{"rigcal", "calibration", "get", "1"}, 1, "no calibration 1; there is c-000001"},
      {{"rigcal", "calibrate", "c-000001"}, 1, "c-000001 is a calibration"},
      {{"rigcal", "calibrate", "wave", "--wait", "--reference-camera", "left"}, 1, "left"},
      {{"rigcal", "session", "create", "--target", kWand, "--id", "wave"}, 1, "wave"},
      {{"rigcal", "session", "create", "--target", kWand, "--id", "my wave"}, 1, "my wave"},
      {{"rigcal", "rig", "activate", "wave"}, 1, "wave is a session"},
      {{"rigcal", "session", "delete", "wave"}, 2, "--yes"},
      {{"rigcal", "calibration", "delete", "c-000001"}, 2, "--yes"},
      {{"rigcal", "session", "stop", "wave", "--drain-timeout", "10s"}, 2, "10s"},
  });
}

TEST_F(NaturalMistakes, FilesAndFolders) {
  Expect({
      {{"rigcal", "local", "--data", "{dir}/nowhere", "--target", kWand}, 1, "there is no folder"},
      {{"rigcal", "local", "--data", "{dir}/notes.txt", "--target", kWand}, 1, "is not a folder"},
      {{"rigcal", "local", "--data", "{dir}/empty", "--target", kWand}, 1, "no recording"},
      {{"rigcal", "local", "--data", "{dir}/single", "--target", kWand}, 1, "only one camera"},
      {{"rigcal", "local", "--data", "{dir}/lensless", "--target", kWand}, 1, "is missing"},
      {{"rigcal", "local", "--data", "{dir}/rig", "--target", "wand:0,130,390"}, 2, "metres"},
      {{"rigcal", "local", "--data", "{dir}/rig"}, 2, "--target"},
      {{"rigcal", "triangulate", "c-000001", "--data", "{dir}/nowhere", "--output", "{dir}/p.csv"},
       1,
       "there is no folder"},
      {{"rigcal", "triangulate", "c-000001", "--data", "{dir}/empty", "--output", "{dir}/p.csv"},
       1,
       "a point needs two"},
      {{"rigcal", "triangulate", "{dir}/rig", "--data", "c-000001", "--output", "{dir}/p.csv"},
       1,
       "c-000001"},
      {{"rigcal", "triangulate", "c-000001", "--data", "{dir}/rig", "--output", "{dir}/there.csv"},
       1,
       "--force"},
      {{"rigcal", "triangulate", "c-000001", "--data", "{dir}/rig", "--output",
        "{dir}/nodir/p.csv"},
       1,
       "there is no folder {dir}/nodir"},
      {{"rigcal", "evaluate", "{dir}/notes.txt", "--ground-truth", "{dir}/notes.txt", "--plot",
        "{dir}/there.csv"},
       1,
       "--force"},
      {{"rigcal", "calibration", "import", "{dir}/multical.json", "--output", "{dir}/out"},
       1,
       "Multical"},
      {{"rigcal", "calibration", "scale", "c-000001", "--distance", "sim_0,sim_1,4000", "--output",
        "{dir}/scaled.json"},
       1,
       "times as long as"},
      {{"rigcal-agent", "simulate", "sim:camera=0;events=1;duration=1", "--output",
        "{dir}/taken.raw"},
       1,
       "--force"},
      {{"rigcal-agent", "mask", "{dir}/empty", "--output", "{dir}/there.csv"}, 1, "--force"},
      {{"rigcal-agent", "tune", "{dir}/empty", "--target", kWand, "--output", "{dir}/there.csv"},
       1,
       "--force"},
      {{"rigcal-agent", "detect", "{dir}/empty", "--target", kWand, "--output", "{dir}/there.csv"},
       1,
       "--force"},
      {{"rigcal", "calibration", "export", "c-000001", "--format", "opncv", "--output",
        "{dir}/out"},
       2,
       "opencv"},
      {{"rigcal", "calibration", "export", "c-000001", "--format", "opencv", "--output",
        "{dir}/notes.txt"},
       1,
       "notes.txt"},
      {{"rigcal", "calibration", "import", "{dir}/picture.png", "--output", "{dir}/out"},
       1,
       "picture.png"},
      {{"rigcal", "calibration", "import", "{dir}/nowhere.yaml", "--output", "{dir}/out"},
       1,
       "nowhere.yaml"},
      {{"rigcal-agent", "info", "{dir}/nowhere.raw"}, 1, "nowhere.raw"},
      {{"rigcal-agent", "info", "{dir}/rig"}, 1, "{dir}/rig"},
      {{"rigcal-agent", "convert", "{dir}/notes.txt", "{dir}/notes.h5"}, 1, "notes.txt"},
      {{"rigcal-agent", "detect", "{dir}/empty", "--target", kWand}, 1, "empty"},
      {{"rigcal-agent", "detect", "{dir}/picture.png", "--target", kWand}, 1, "picture.png"},
      {{"rigcal-agent", "detect", "{dir}/nowhere", "--target", kWand}, 1, "nowhere"},
      {{"rigcal-agent", "--config", "{dir}/nowhere.toml"}, 1, "nowhere.toml"},
      {{"rigcal-agent", "--config", "{dir}/notes.txt"}, 1, "notes.txt"},
      {{"rigcal-server", "--config", "{dir}/notes.txt"}, 1, "notes.txt"},
      {{"rigcal-server", "restore", "{dir}/notes.txt", "--data-dir", "{dir}/new"}, 1, "notes.txt"},
      {{"rigcal-server", "check", "--data-dir", "{dir}/empty"}, 1, "no database"},
  });
}

TEST_F(NaturalMistakes, ServersAndPorts) {
  Expect({
      {{"rigcal", "session", "list", "--server", "127.0.0.1:1"}, 6, "Is rigcal-server running"},
      {{"rigcal", "session", "list", "--server", "{http}"}, 6, "HTTP port"},
      {{"rigcal", "session", "list", "--server", "http://{host}"}, 2, "without http://"},
      {{"rigcal", "session", "list", "--server", "127.0.0.1"}, 2, "HOST:PORT"},
      {{"rigcal-server", "--listen", "{host}", "--data-dir", "{dir}/other"}, 1, "{host}"},
      {{"rigcal-server", "--listen", "{host}", "--data-dir", "{dir}/store"}, 1, "{dir}/store"},
      {{"rigcal-server", "--listen", "127.0.0.1:port", "--data-dir", "{dir}/other"}, 2, "port"},
      {{"rigcal-agent", "--source", "csv:{dir}/nowhere.csv", "--state-dir", "{dir}/x"},
       2,
       "nowhere"},
      {{"rigcal-agent", "--source", "webcam:0", "--state-dir", "{dir}/x"}, 2, "webcam"},
      {{"rigcal-agent", "--server", "http://{host}", "--source", "sim:camera=0", "--state-dir",
        "{dir}/x"},
       2,
       "HOST:PORT"},
      {{"rigcal-agent", "--agent-id", "my pc", "--source", "sim:camera=0", "--state-dir",
        "{dir}/x"},
       2,
       "my pc"},
  });
}

}  // namespace
}  // namespace rigcal::testing::natural_mistakes_test
