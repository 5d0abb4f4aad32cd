// SPDX-License-Identifier: Apache-2.0
// Captures test frames from a GigE Vision camera for some seconds, checks every byte, and prints
// one line of counts: received, lost, damaged ones.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>

#include "agent/capture/genicam/aravis_frame_source.h"
#include "tests/testing/fake_gige_camera.h"

namespace {

// True if this process may open packet sockets (capabilities(7), bit 13).
bool HasCapNetRaw() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("CapEff:", 0) == 0) return std::stoull(line.substr(7), nullptr, 16) >> 13 & 1;
  }
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  rigcal::agent::AravisSourceOptions options;
  options.camera = "gige";
  options.device = "127.0.0.1";
  options.frame_rate_hz = 50;
  double seconds = 20;
  CLI::App app("Captures test frames of a fake GigE Vision camera.");
  app.add_option("--device", options.device, "address or id")->capture_default_str();
  app.add_option("--interface", options.network_interface, "network interface");
  app.add_option("--rate", options.frame_rate_hz, "frames per second");
  app.add_option("--trigger", options.trigger, "free or software")->capture_default_str();
  app.add_option("--packet-size", options.packet_size, "bytes")->capture_default_str();
  app.add_option("--seconds", seconds, "how long")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  spdlog::set_default_logger(spdlog::stderr_logger_mt("gige-capture"));

  auto source = rigcal::agent::AravisFrameSource::Create(options);
  if (!source.ok()) {
    std::fprintf(stderr, "%s\n", std::string(source.status().message()).c_str());
    return 1;
  }
  const absl::Status started = (*source)->Start({});
  if (!started.ok()) {
    std::fprintf(stderr, "%s\n", std::string(started.message()).c_str());
    return 1;
  }
  std::thread end([&] {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    (*source)->Stop();
  });
  unsigned long long yielded = 0;
  unsigned long long wrong = 0;
  while (true) {
    const auto frame = (*source)->Next();
    if (!frame.ok() || !frame->has_value()) break;
    ++yielded;
    const rigcal::agent::ImageView& image = (*frame)->image;
    const size_t size = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
    if (!rigcal::testing::TestImageIndex({image.data, size})) ++wrong;
  }
  end.join();
  const rigcal::FrameCounts counts = (*source)->counts();
  std::printf(
      "received %llu damaged %llu lost %llu reconnects %llu yielded %llu wrong %llu "
      "cap_net_raw %d\n",
      static_cast<unsigned long long>(counts.received),
      static_cast<unsigned long long>(counts.damaged), static_cast<unsigned long long>(counts.lost),
      static_cast<unsigned long long>(counts.reconnects), yielded, wrong, HasCapNetRaw() ? 1 : 0);
  return 0;
}
