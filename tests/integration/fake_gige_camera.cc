// SPDX-License-Identifier: Apache-2.0
// A GigE Vision camera as a program: frames over the real protocol, on this machine. Prints
// "ready" when it answers, and the number of frames sent when it ends.
#include "tests/testing/fake_gige_camera.h"

#include <signal.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "common/options/option_table.h"
#include "tests/testing/rendered_frames.h"

namespace {

using rigcal::testing::FakeGigeCamera;
using rigcal::testing::FakeGigeCameraOptions;
using rigcal::testing::RenderedFrames;
using rigcal::testing::RenderedFramesOptions;

// "camera=2;seed=3;lux=50" as for the agent's sim: the world's options and the frames'.
absl::Status ParseSimulation(const std::string& text, RenderedFramesOptions* options) {
  const auto given = rigcal::SplitOptionList(text);
  if (!given.ok()) return given.status();
  rigcal::OptionTable table;
  table.Add("camera", &options->camera_index, {0, 99}, "index of the camera");
  AddOptions(&options->simulation, &table);
  AddOptions(&options->rendering, &table);
  rigcal::FaultList faults;
  table.Read(*given, &faults);
  faults.Add(options->simulation.Validate());
  faults.Add(options->rendering.Validate());
  if (options->camera_index >= options->simulation.camera_count) {
    faults.Add("no camera ", options->camera_index, " in a world of ",
               options->simulation.camera_count);
  }
  return faults.Result();
}

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  FakeGigeCameraOptions options;
  RenderedFramesOptions rendered;
  std::string simulation;
  std::string target = "wand:0,0.13,0.39";
  std::string calibration_path;
  CLI::App app(
      "A GigE Vision camera without hardware, on an address of this machine. Sends test pictures, "
      "or what a camera of a simulated world sees.");
  app.add_option("--address", options.address, "its address, and with it the interface")
      ->capture_default_str();
  app.add_option("--serial", options.serial, "its serial number")->capture_default_str();
  app.add_option("--width", options.width, "pixels, of test pictures")->capture_default_str();
  app.add_option("--height", options.height, "pixels, of test pictures")->capture_default_str();
  app.add_option("--pixel-format", options.pixel_format, "Mono8, BayerRG8 (GR, GB, BG) or RGB8")
      ->capture_default_str();
  app.add_option("--rate", options.frame_rate_hz, "test pictures a second")->capture_default_str();
  app.add_option("--lose-packets", options.lost_packet_share, "share of packets not sent")
      ->capture_default_str();
  app.add_option(
      "--simulation", simulation,
      "pictures of this world and camera: \"camera=0;seed=1;cameras=4;rate=50;lux=200\"");
  app.add_option("--target", target, "what is waved in it")->capture_default_str();
  app.add_option("--threads", rendered.threads, "that render")->capture_default_str();
  app.add_option("--ahead", rendered.ahead, "pictures rendered before they are due")
      ->capture_default_str();
  app.add_option("--write-calibration", calibration_path,
                 "where to write the simulated camera's intrinsics and pose (YAML)");
  CLI11_PARSE(app, argc, argv);

  // Before any thread, so that all of them leave these two signals to sigwait.
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGINT);
  sigaddset(&ending, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);

  std::unique_ptr<RenderedFrames> pictures;
  if (!simulation.empty()) {
    auto parsed_target = rigcal::ParseTarget(target);
    if (!parsed_target.ok()) return Fail(parsed_target.status());
    rendered.target = *parsed_target;
    rendered.pixel_format = options.pixel_format;
    if (const absl::Status status = ParseSimulation(simulation, &rendered); !status.ok()) {
      return Fail(status);
    }
    auto created = RenderedFrames::Create(rendered);
    if (!created.ok()) return Fail(created.status());
    pictures = *std::move(created);
    options.width = static_cast<int>(pictures->image_size_px().width);
    options.height = static_cast<int>(pictures->image_size_px().height);
    options.frame_rate_hz = pictures->rate_hz();
    options.exposure_s = rendered.rendering.exposure_s;
    options.fill = [&](uint64_t, double exposure_s, std::span<uint8_t> pixels) {
      return pictures->TakeNow(exposure_s, pixels);
    };
    if (!calibration_path.empty()) {
      const absl::Status status =
          rigcal::WriteCameraExport(calibration_path, pictures->Export(options.serial));
      if (!status.ok()) return Fail(status);
    }
  }
  auto camera = FakeGigeCamera::Create(options);
  if (!camera.ok()) return Fail(camera.status());
  std::printf("ready %s at %s\n", (*camera)->id().c_str(), options.address.c_str());
  std::fflush(stdout);
  int signal = 0;
  sigwait(&ending, &signal);
  const auto sent = static_cast<unsigned long long>((*camera)->sent());
  camera->reset();
  std::printf("sent %llu late %llu\n", sent,
              static_cast<unsigned long long>(pictures ? pictures->late() : 0));
  return 0;
}
