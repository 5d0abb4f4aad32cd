// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/fake_gige_camera.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/aravis_objects.h"

namespace rigcal::testing {
namespace {

constexpr uint16_t kControlPort = 3956;

// A lock of an address between processes. It lives as long as the socket, so that a killed process
// leaves nothing behind.
class AddressLock {
 public:
  ~AddressLock() {
    if (fd_ >= 0) close(fd_);
  }
  bool TryLock(const std::string& address) {
    if (fd_ < 0) fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    const std::string text = "rigcal-fake-gige-" + address;
    std::memcpy(name.sun_path + 1, text.data(), std::min(text.size(), sizeof name.sun_path - 1));
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
    return bind(fd_, reinterpret_cast<const sockaddr*>(&name), size) == 0;
  }

 private:
  int fd_ = -1;
};

// Aravis does not report a port in use.
bool PortIsFree(const std::string& address) {
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_port = htons(kControlPort);
  if (inet_pton(AF_INET, address.c_str(), &name.sin_addr) != 1) return false;
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool free = bind(fd, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  close(fd);
  return free;
}

const std::map<std::string, ArvPixelFormat>& PixelFormats() {
  static const std::map<std::string, ArvPixelFormat> formats{
      {"Mono8", ARV_PIXEL_FORMAT_MONO_8},        {"BayerRG8", ARV_PIXEL_FORMAT_BAYER_RG_8},
      {"BayerGR8", ARV_PIXEL_FORMAT_BAYER_GR_8}, {"BayerGB8", ARV_PIXEL_FORMAT_BAYER_GB_8},
      {"BayerBG8", ARV_PIXEL_FORMAT_BAYER_BG_8}, {"RGB8", ARV_PIXEL_FORMAT_RGB_8_PACKED},
      {"Mono16", ARV_PIXEL_FORMAT_MONO_16}};
  return formats;
}

}  // namespace

struct FakeGigeCamera::Impl {
  AddressLock lock;
  agent::GObjectPtr<ArvGvFakeCamera> camera;

  ArvFakeCamera* registers() const { return arv_gv_fake_camera_get_fake_camera(camera.get()); }
};

FakeGigeCamera::FakeGigeCamera(FakeGigeCameraOptions options)
    : options_(std::move(options)), impl_(std::make_unique<Impl>()) {}

FakeGigeCamera::~FakeGigeCamera() {
  // Its thread calls Fill(), which reads its registers, until it has ended.
  if (impl_->camera) g_object_unref(impl_->camera.get());
  impl_->camera.release();
}

absl::StatusOr<std::unique_ptr<FakeGigeCamera>> FakeGigeCamera::Create(
    FakeGigeCameraOptions options) {
  const auto format = PixelFormats().find(options.pixel_format);
  if (format == PixelFormats().end()) {
    return absl::InvalidArgumentError("the fake camera has no " + options.pixel_format);
  }
  std::unique_ptr<FakeGigeCamera> fake(new FakeGigeCamera(std::move(options)));
  const FakeGigeCameraOptions& set = fake->options_;
  const auto deadline = std::chrono::steady_clock::now() + set.wait_for_address;
  while (!fake->impl_->lock.TryLock(set.address) || !PortIsFree(set.address)) {
    if (std::chrono::steady_clock::now() > deadline) {
      return absl::UnavailableError(absl::StrCat("UDP port ", kControlPort, " of ", set.address,
                                                 " is in use, or the address is not ours"));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const char* const genicam = set.genicam_path.empty() ? nullptr : set.genicam_path.c_str();
  fake->impl_->camera.reset(ARV_GV_FAKE_CAMERA(
      g_object_new(ARV_TYPE_GV_FAKE_CAMERA, "interface-name", set.address.c_str(), "serial-number",
                   set.serial.c_str(), "genicam-filename", genicam, "gvsp-lost-ratio",
                   set.lost_packet_share, nullptr)));
  if (!arv_gv_fake_camera_is_running(fake->impl_->camera.get())) {
    return absl::UnavailableError("no network interface has the address " + set.address);
  }
  fake->WriteRegister(ARV_FAKE_CAMERA_REGISTER_WIDTH, static_cast<uint32_t>(set.width));
  fake->WriteRegister(ARV_FAKE_CAMERA_REGISTER_HEIGHT, static_cast<uint32_t>(set.height));
  fake->WriteRegister(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, format->second);
  fake->WriteRegister(ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US,
                      static_cast<uint32_t>(1e6 / set.frame_rate_hz));
  fake->WriteRegister(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US,
                      static_cast<uint32_t>(set.exposure_s * 1e6));
  // How often it polls for a trigger.
  arv_fake_camera_set_trigger_frequency(fake->impl_->registers(), 1000);
  arv_fake_camera_set_fill_pattern(
      fake->impl_->registers(),
      [](ArvBuffer* buffer, void* self, guint32 exposure_us, guint32, ArvPixelFormat) {
        static_cast<FakeGigeCamera*>(self)->Fill(buffer, exposure_us * 1e-6);
      },
      fake.get());
  return fake;
}

void FakeGigeCamera::Fill(void* buffer, double exposure_s) {
  auto* const arv_buffer = static_cast<ArvBuffer*>(buffer);
  size_t received = 0;  // stays 0: nothing was received into this buffer
  void* const data = const_cast<void*>(arv_buffer_get_data(arv_buffer, &received));
  const size_t size =
      size_t{ReadRegister(ARV_FAKE_CAMERA_REGISTER_WIDTH)} *
      ReadRegister(ARV_FAKE_CAMERA_REGISTER_HEIGHT) *
      ARV_PIXEL_FORMAT_BIT_PER_PIXEL(ReadRegister(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT)) / 8;
  const std::span<uint8_t> pixels(static_cast<uint8_t*>(data), size);
  const std::optional<int64_t> stamp_ns = options_.fill ? options_.fill(sent_, exposure_s, pixels)
                                                        : FillTestImage(sent_, exposure_s, pixels);
  if (stamp_ns) arv_buffer_set_timestamp(arv_buffer, static_cast<uint64_t>(*stamp_ns));
  ++sent_;
}

void FakeGigeCamera::WriteRegister(uint32_t address, uint32_t value) {
  arv_fake_camera_write_register(impl_->registers(), address, value);
}

uint32_t FakeGigeCamera::ReadRegister(uint32_t address) const {
  uint32_t value = 0;
  arv_fake_camera_read_register(impl_->registers(), address, &value);
  return value;
}

std::optional<int64_t> FillTestImage(uint64_t index, double, std::span<uint8_t> pixels) {
  const auto first = static_cast<uint8_t>(index * 7);
  if (pixels.size() < 8) return std::nullopt;
  std::memset(pixels.data(), first, pixels.size());
  // Every 1024th byte depends on its place, so that misplaced packets show.
  for (size_t i = 0; i < pixels.size(); i += 1024) {
    pixels[i] = static_cast<uint8_t>(index + i / 1024);
  }
  for (size_t i = 0; i < 8; ++i) pixels[i] = static_cast<uint8_t>(index >> (8 * i));
  return std::nullopt;
}

std::optional<uint64_t> TestImageIndex(std::span<const uint8_t> pixels) {
  if (pixels.size() < 8) return std::nullopt;
  uint64_t index = 0;
  for (size_t i = 0; i < 8; ++i) index |= uint64_t{pixels[i]} << (8 * i);
  const auto filling = static_cast<uint8_t>(index * 7);
  for (size_t i = 8; i < pixels.size(); ++i) {
    const uint8_t expected = i % 1024 == 0 ? static_cast<uint8_t>(index + i / 1024) : filling;
    if (pixels[i] != expected) return std::nullopt;
  }
  return index;
}

std::string FakeCameraXml(const std::string& more) {
  const agent::GObjectPtr<ArvFakeCamera> camera(arv_fake_camera_new("XML"));
  size_t size = 0;
  const char* const text = arv_fake_camera_get_genicam_xml(camera.get(), &size);
  std::string xml(text, size);
  const std::string end = "</RegisterDescription>";
  const size_t at = xml.rfind(end);
  if (at != std::string::npos) xml.insert(at, more);
  return xml;
}

}  // namespace rigcal::testing
