// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal::testing {

// Writes frame `index` (from 0) in the camera's pixel format, rows without padding. Returns its
// device timestamp, ns (none: the camera's own clock). Called by the thread that also handles the
// camera's control packets: it must be quick.
using FillImage = std::function<std::optional<int64_t>(uint64_t index, double exposure_s,
                                                       std::span<uint8_t> pixels)>;

struct FakeGigeCameraOptions {
  std::string address = "127.0.0.1";  // of this machine; one camera per address
  std::string serial = "RIGCAL01";
  int width = 1280;
  int height = 1024;
  std::string pixel_format = "Mono8";  // Mono8, BayerRG8 (GR, GB, BG), RGB8
  double frame_rate_hz = 50;           // unless the client sets it
  double exposure_s = 0.005;           // unless the client sets it
  double lost_packet_share = 0;        // of packets that are not sent, 0 to 1
  std::string genicam_path;            // GenICam description; empty: Aravis' own
  FillImage fill;                      // empty: FillTestImage
  // How long to wait for another camera at this address, of any process, to end.
  std::chrono::seconds wait_for_address{60};
};

// Aravis' fake GigE Vision camera: real control and stream packets over UDP, on this machine.
class FakeGigeCamera {
 public:
  // UNAVAILABLE: the address or its port 3956 is in use or not of this machine.
  static absl::StatusOr<std::unique_ptr<FakeGigeCamera>> Create(FakeGigeCameraOptions options);
  ~FakeGigeCamera();
  FakeGigeCamera(const FakeGigeCamera&) = delete;
  FakeGigeCamera& operator=(const FakeGigeCamera&) = delete;

  // Frames sent so far.
  uint64_t sent() const { return sent_; }
  // "Aravis-RIGCAL01", as Aravis names it.
  std::string id() const { return "Aravis-" + options_.serial; }
  // One of the camera's registers, by its address.
  void WriteRegister(uint32_t address, uint32_t value);
  uint32_t ReadRegister(uint32_t address) const;

 private:
  struct Impl;
  explicit FakeGigeCamera(FakeGigeCameraOptions options);
  void Fill(void* buffer, double exposure_s);

  const FakeGigeCameraOptions options_;
  std::atomic<uint64_t> sent_ = 0;
  std::unique_ptr<Impl> impl_;
};

// A frame that contains its index: the first eight bytes hold it, low byte first; the others follow
// from it and their position. Returns no timestamp.
std::optional<int64_t> FillTestImage(uint64_t index, double exposure_s, std::span<uint8_t> pixels);
// Index of the test frame with exactly these pixels; none if a byte differs.
std::optional<uint64_t> TestImageIndex(std::span<const uint8_t> pixels);

// Aravis' own description of the fake camera, with `more` nodes added.
std::string FakeCameraXml(const std::string& more);

}  // namespace rigcal::testing
