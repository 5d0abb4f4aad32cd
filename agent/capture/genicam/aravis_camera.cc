// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_camera.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/capture/camera_status.h"
#include "agent/capture/device_clock.h"
#include "agent/capture/genicam/aravis_discovery.h"
#include "agent/capture/genicam/aravis_settings.h"
#include "agent/capture/genicam/usb_cameras.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::milliseconds kAnswerLimit(1000);
// GigE Vision's bootstrap registers: who holds the camera.
constexpr uint64_t kControllerAddressRegister = 0x0a14;
constexpr uint64_t kControllerPortRegister = 0x0a04;

// Aravis' camera without a network, for trying things out.
bool IsAravisFake(const std::string& device) { return device.rfind("Fake_", 0) == 0; }

absl::Status NotThere(const std::string& what, const AravisSourceOptions& options,
                      bool list_others) {
  if (!list_others) return absl::NotFoundError(what);
  const absl::StatusOr<std::vector<FoundCamera>> present = FindCameras(options.network_interface);
  if (!present.ok()) {
    return absl::Status(
        present.status().code(),
        absl::StrCat(what, "; looking for others: ", std::string(present.status().message())));
  }
  return absl::NotFoundError(
      absl::StrCat(what, "; cameras that answer: ", DescribeCameras(*present),
                   ". Is it powered and plugged in, and this machine's address in its network?"));
}

absl::StatusOr<GObjectPtr<ArvDevice>> OpenByAddress(const AravisSourceOptions& options,
                                                    const std::string& address) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string local,
                          LocalAddressFor(address, options.network_interface));
  const GObjectPtr<GInetAddress> host(g_inet_address_new_from_string(local.c_str()));
  const GObjectPtr<GInetAddress> remote(g_inet_address_new_from_string(address.c_str()));
  GErrorSlot error;
  GObjectPtr<ArvDevice> device(arv_gv_device_new(host.get(), remote.get(), error.out()));
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot open " + address));
  if (!device) return absl::UnavailableError("cannot open " + address);
  return device;
}

absl::StatusOr<GObjectPtr<ArvDevice>> OpenDevice(const AravisSourceOptions& options,
                                                 bool list_others, std::string* id) {
  *id = options.device;
  if (IsAravisFake(options.device)) {
    arv_enable_interface("Fake");
  } else if (IsIpv4Address(options.device)) {
    // Aravis would try for seconds, and could not say who is there.
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<FoundCamera> answer,
                            AskCamera(options.device, options.network_interface, kAnswerLimit));
    if (!answer) {
      return NotThere("no camera answers at " + options.device, options, list_others);
    }
    *id = answer->id;
    return OpenByAddress(options, options.device);
  } else {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<FoundCamera> present,
                            FindCameras(options.network_interface));
    const auto found = std::ranges::find_if(
        present, [&](const FoundCamera& camera) { return camera.IsNamed(options.device); });
    if (found == present.end()) {
      return absl::NotFoundError(absl::StrCat("no camera ", options.device,
                                              "; cameras that answer: ", DescribeCameras(present),
                                              UnusableUsbCameras()));
    }
    *id = found->id;
    if (found->protocol == "GigEVision") return OpenByAddress(options, found->address);
  }
  GErrorSlot error;
  GObjectPtr<ArvDevice> device(arv_open_device(id->c_str(), error.out()));
  if (const absl::Status status = error.ToStatus("cannot open " + *id); !status.ok()) {
    return absl::Status(status.code(), absl::StrCat(status.message(), UnusableUsbCameras()));
  }
  if (!device) return NotThere("cannot open " + *id, options, list_others);
  return device;
}

absl::Status CheckControl(ArvDevice* device, const std::string& id) {
  if (!ARV_IS_GV_DEVICE(device) || arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
    return absl::OkStatus();
  }
  GErrorSlot error;
  uint32_t address = 0;
  uint32_t port = 0;
  arv_device_read_register(device, kControllerAddressRegister, &address, error.out());
  if (!error.ok()) address = 0;
  arv_device_read_register(device, kControllerPortRegister, &port, error.out());
  const std::string holder =
      address == 0 ? "a program that the camera does not name"
                   : absl::StrCat("a program at ", address >> 24, ".", address >> 16 & 255, ".",
                                  address >> 8 & 255, ".", address & 255, ", port ", port & 65535);
  return absl::FailedPreconditionError(
      absl::StrCat(id, " is held by ", holder, "; end that program, then try again"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<AravisCamera>> AravisCamera::Open(const AravisSourceOptions& options,
                                                                 bool list_others) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<AravisCamera> camera(new AravisCamera);
  RIGCAL_RETURN_IF_ERROR(OfCamera(options.camera, camera->Connect(options, list_others)));
  RIGCAL_RETURN_IF_ERROR(OfCamera(options.camera, camera->Configure(options)));
  return camera;
}

absl::Status AravisCamera::Connect(const AravisSourceOptions& options, bool list_others) {
  RIGCAL_ASSIGN_OR_RETURN(const GObjectPtr<ArvDevice> device,
                          OpenDevice(options, list_others, &device_id_));
  RIGCAL_RETURN_IF_ERROR(CheckControl(device.get(), device_id_));
  GErrorSlot error;
  camera_.reset(arv_camera_new_with_device(device.get(), error.out()));
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot use " + device_id_));
  if (!camera_) return absl::InternalError("cannot use " + device_id_);
  handler_ = g_signal_connect(device.get(), "control-lost",
                              G_CALLBACK(&AravisCamera::OnControlLost), this);
  return absl::OkStatus();
}

absl::Status AravisCamera::Configure(const AravisSourceOptions& options) {
  RIGCAL_RETURN_IF_ERROR(ApplySettings(camera_.get(), options));
  RIGCAL_RETURN_IF_ERROR(CheckPixelFormat(camera_.get()));
  GErrorSlot error;
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  arv_camera_get_region(camera_.get(), &x, &y, &width, &height, error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot read its frame size"));
  image_size_px_ = {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
  if (is_gige()) {
    // A packet socket needs CAP_NET_RAW and sees nothing on some interfaces; without it a plain
    // user and root go the same way.
    arv_camera_gv_set_stream_options(camera_.get(), ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    arv_camera_gv_set_packet_size_adjustment(
        camera_.get(), options.packet_size == 0 ? ARV_GV_PACKET_SIZE_ADJUSTMENT_ONCE
                                                : ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    if (options.packet_size != 0) {
      arv_camera_gv_set_packet_size(camera_.get(), options.packet_size, error.out());
      RIGCAL_RETURN_IF_ERROR(
          error.ToStatus(absl::StrCat("cannot set a packet size of ", options.packet_size)));
    }
  }
  settings_ = ReadSettings(camera_.get());
  if (settings_.trigger == "software") settings_.frame_rate_hz = options.frame_rate_hz.value_or(0);
  ptp_clock_id_ = settings_.ptp ? PtpClockId(camera_.get()) : "";
  exposure_is_automatic_ = ExposureIsAutomatic(camera_.get());
  FindClock();
  return absl::OkStatus();
}

AravisCamera::~AravisCamera() {
  if (handler_ != 0) g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), handler_);
}

void AravisCamera::OnControlLost(ArvDevice*, void* self) {
  static_cast<AravisCamera*>(self)->control_lost_ = true;
}

absl::StatusOr<uint32_t> AravisCamera::PayloadBytes() const {
  GErrorSlot error;
  const uint32_t bytes = arv_camera_get_payload(camera_.get(), error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot read its payload size"));
  if (bytes == 0) return absl::InternalError("its payload size is 0");
  return bytes;
}

void AravisCamera::FindClock() {
  const auto has = [&](const char* feature) { return FeatureIsAvailable(camera_.get(), feature); };
  if (has("TimestampLatch") && has("TimestampLatchValue")) {
    latch_command_ = "TimestampLatch";
    latch_value_ = "TimestampLatchValue";
    return;
  }
  if (!has("GevTimestampControlLatch") || !has("GevTimestampValue") || !is_gige()) return;
  GErrorSlot error;
  const uint64_t ticks_hz = arv_gv_device_get_timestamp_tick_frequency(
      ARV_GV_DEVICE(arv_camera_get_device(camera_.get())), error.out());
  if (!error.ok() || ticks_hz == 0) return;
  latch_command_ = "GevTimestampControlLatch";
  latch_value_ = "GevTimestampValue";
  ns_per_tick_ = 1e9 / static_cast<double>(ticks_hz);
}

absl::StatusOr<ClockSample> AravisCamera::ReadClock() const {
  GErrorSlot error;
  const int64_t before_ns = MonotonicNowNs();
  arv_camera_execute_command(camera_.get(), latch_command_, error.out());
  const int64_t after_ns = MonotonicNowNs();
  const int64_t utc_ns = UtcNowNs();
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot latch its clock"));
  const int64_t ticks = arv_camera_get_integer(camera_.get(), latch_value_, error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot read its clock"));
  const int64_t middle_ns = before_ns + (after_ns - before_ns) / 2;
  return ClockSample{
      // Doubles hold a hundred days of nanoseconds; ticks of another length are scaled in long
      // double.
      .device_ns = ns_per_tick_ == 1
                       ? ticks
                       : static_cast<int64_t>(static_cast<long double>(ticks) * ns_per_tick_),
      .host_monotonic_ns = middle_ns,
      .host_utc_ns = utc_ns - (after_ns - middle_ns),
      // Anywhere within the round trip: its length by the square root of 12.
      .uncertainty_ns =
          static_cast<uint32_t>(static_cast<double>(after_ns - before_ns) * 0.2887) + 1};
}

}  // namespace rigcal::agent
