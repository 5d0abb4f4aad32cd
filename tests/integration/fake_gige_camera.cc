// SPDX-License-Identifier: Apache-2.0
// A GigE Vision camera that is a program: test pictures over the true protocol, on this machine.
// Prints "ready" when it answers, and what it has sent when it is told to end.
#include "tests/testing/fake_gige_camera.h"

#include <signal.h>

#include <CLI/CLI.hpp>
#include <cstdio>

int main(int argc, char** argv) {
  rigcal::testing::FakeGigeCameraOptions options;
  CLI::App app("A GigE Vision camera without hardware, on an address of this machine.");
  app.add_option("--address", options.address, "its address, and with it the interface")
      ->capture_default_str();
  app.add_option("--serial", options.serial, "its serial number")->capture_default_str();
  app.add_option("--width", options.width, "pixels")->capture_default_str();
  app.add_option("--height", options.height, "pixels")->capture_default_str();
  app.add_option("--pixel-format", options.pixel_format, "Mono8, BayerRG8 or RGB8")
      ->capture_default_str();
  app.add_option("--rate", options.frame_rate_hz, "pictures a second")->capture_default_str();
  app.add_option("--lose-packets", options.lost_packet_share, "share of packets not sent")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  // Before any thread, so that all of them leave these two signals to sigwait.
  sigset_t ending;
  sigemptyset(&ending);
  sigaddset(&ending, SIGINT);
  sigaddset(&ending, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);

  auto camera = rigcal::testing::FakeGigeCamera::Create(options);
  if (!camera.ok()) {
    std::fprintf(stderr, "%s\n", std::string(camera.status().message()).c_str());
    return 1;
  }
  std::printf("ready %s at %s\n", (*camera)->id().c_str(), options.address.c_str());
  std::fflush(stdout);
  int signal = 0;
  sigwait(&ending, &signal);
  std::printf("sent %llu\n", static_cast<unsigned long long>((*camera)->sent()));
  return 0;
}
