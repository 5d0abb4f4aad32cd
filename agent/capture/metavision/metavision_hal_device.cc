// SPDX-License-Identifier: Apache-2.0
// MetavisionDevice on the hardware layer of OpenEB and the Metavision SDK, 4.1 to 5.x.
#include <metavision/hal/device/device.h>
#include <metavision/hal/device/device_discovery.h>
#include <metavision/hal/facilities/i_events_stream.h>
#include <metavision/hal/facilities/i_geometry.h>
#include <metavision/hal/facilities/i_hw_identification.h>
#include <metavision/hal/utils/device_config.h>
#include <metavision/hal/utils/raw_file_header.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_join.h"
#include "agent/capture/camera_status.h"
#include "agent/capture/metavision/metavision_device.h"
#include "agent/capture/metavision/metavision_hal_errors.h"
#include "agent/capture/metavision/metavision_hal_settings.h"
#include "agent/event_files/raw_header.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kMaxSide = 2048;  // 11 bits

// The bytes of a stream in the way of its version: 5.x hands out buffers that keep themselves
// alive, 4.x a pointer that is good until the next call.
template <typename Stream>
class LatestBytes {
 public:
  std::span<const uint8_t> Fetch(Stream& stream) {
    if constexpr (kOwnsItself) {
      buffer_ = stream.get_latest_raw_data();
      if (!buffer_) return {};
      return {buffer_.data(), buffer_.size()};
    } else {
      long size = 0;  // NOLINT: as the SDK has it
      const auto* const bytes = stream.get_latest_raw_data(size);
      if (bytes == nullptr || size <= 0) return {};
      return {bytes, static_cast<size_t>(size)};
    }
  }
  void Release() { buffer_ = {}; }

 private:
  static constexpr bool kOwnsItself = requires(Stream & stream) { stream.get_latest_raw_data(); };
  template <typename S, bool owns>
  struct BufferOf {
    using Type = const void*;
  };
  template <typename S>
  struct BufferOf<S, true> {
    using Type = decltype(std::declval<S&>().get_latest_raw_data());
  };

  typename BufferOf<Stream, kOwnsItself>::Type buffer_{};
};

class HalDevice : public MetavisionDevice {
 public:
  HalDevice(std::unique_ptr<Metavision::Device> device, Metavision::I_EventsStream* stream,
            MetavisionIdentity identity)
      : device_(std::move(device)), stream_(stream), identity_(std::move(identity)) {}
  ~HalDevice() override { Stop(); }

  const MetavisionIdentity& identity() const override { return identity_; }

  absl::Status Start() override {
    started_ = true;
    return WithoutExceptions("cannot start the stream", [this] { stream_->start(); });
  }

  void Stop() override {
    if (!std::exchange(started_, false)) return;
    latest_.Release();
    const absl::Status status =
        WithoutExceptions("cannot stop the stream", [this] { stream_->stop(); });
    if (!status.ok()) {
      spdlog::debug("event camera {}: {}", identity_.serial, std::string(status.message()));
    }
  }

  absl::StatusOr<std::span<const uint8_t>> Read() override {
    std::span<const uint8_t> bytes;
    bool ended = false;
    RIGCAL_RETURN_IF_ERROR(WithoutExceptions("cannot read events", [&] {
      const short state = stream_->poll_buffer();  // NOLINT: as the SDK has it
      ended = state < 0;
      if (state > 0) bytes = latest_.Fetch(*stream_);
    }));
    if (ended) return absl::UnavailableError("its stream of events has ended");
    return bytes;
  }

 private:
  const std::unique_ptr<Metavision::Device> device_;
  Metavision::I_EventsStream* const stream_;  // of device_
  const MetavisionIdentity identity_;
  LatestBytes<Metavision::I_EventsStream> latest_;
  bool started_ = false;
};

std::string Listed(const std::vector<std::string>& serials) {
  return serials.empty() ? "none; is it plugged in, is the camera's plugin found "
                           "(MV_HAL_PLUGIN_PATH), may this user open it (udev rules)?"
                         : absl::StrJoin(serials, ", ");
}

// What to ask for: the camera that is named, or the only one there is.
absl::StatusOr<std::string> ChooseSerial(const MetavisionRequest& request) {
  if (!request.serial.empty()) return request.serial;
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<std::string> found, FindMetavisionDevices());
  if (found.size() > 1) {
    return absl::FailedPreconditionError(
        absl::StrCat("there are several event cameras: ", absl::StrJoin(found, ", "),
                     "; name one with serial=NUMBER"));
  }
  return found.empty() ? "" : found.front();
}

absl::StatusOr<std::unique_ptr<Metavision::Device>> OpenDevice(const MetavisionRequest& request,
                                                               const std::string& serial) {
  std::unique_ptr<Metavision::Device> device;
  const absl::Status status = WithoutExceptions("cannot open it", [&] {
    Metavision::DeviceConfig config;
    if (!request.config.format.empty()) config.set_format(request.config.format);
    device = Metavision::DeviceDiscovery::open(serial, config);
  });
  if (device) return device;
  const std::string which = serial.empty() ? "there is no event camera"
                                           : absl::StrCat("there is no event camera ", serial);
  const absl::StatusOr<std::vector<std::string>> found = FindMetavisionDevices();
  return absl::Status(
      status.ok() ? absl::StatusCode::kNotFound : status.code(),
      absl::StrCat(status.ok() ? which : std::string(status.message()), "; found: ",
                   found.ok() ? Listed(*found) : std::string(found.status().message())));
}

// The format in the words of a RAW header; only there EVT 2.1 says in which order its
// halves come.
absl::Status ReadFormat(const Metavision::I_HW_Identification& about,
                        MetavisionIdentity* identity) {
  const std::string current = about.get_current_data_encoding_format();
  std::string name = about.get_header().get_field("format");
  if (name.empty()) name = current;
  const std::string text = absl::StrCat("% format ", name, "\n% end\n");
  const absl::StatusOr<EventFileHeader> header =
      ParseRawHeader({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  if (!header.ok()) {
    return NotOffered(
        "it sends events as \"", name, "\": ", std::string(header.status().message()),
        "; it offers: ", absl::StrJoin(about.get_available_data_encoding_formats(), ", "),
        "; ask for one with format = \"EVT3\" in the file that biases= names");
  }
  identity->format = header->format;
  identity->format_name = header->format_name;
  identity->halves_swapped = header->halves_swapped;
  return absl::OkStatus();
}

absl::StatusOr<MetavisionIdentity> Identify(Metavision::Device& device) {
  const auto* const about = device.get_facility<Metavision::I_HW_Identification>();
  const auto* const geometry = device.get_facility<Metavision::I_Geometry>();
  if (about == nullptr || geometry == nullptr) {
    return NotOffered("its plugin reports neither type nor size; is it an event camera?");
  }
  MetavisionIdentity identity;
  identity.serial = about->get_serial();
  identity.model = absl::StrCat(about->get_integrator(), " ", about->get_sensor_info().name_);
  const int width = geometry->get_width();
  const int height = geometry->get_height();
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    return NotOffered("its sensor has ", width, "x", height, " pixels, but 1 to ", kMaxSide,
                      " each way are supported");
  }
  identity.geometry = {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
  RIGCAL_RETURN_IF_ERROR(ReadFormat(*about, &identity));
  return identity;
}

absl::StatusOr<std::unique_ptr<MetavisionDevice>> Open(const MetavisionRequest& request) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string serial, ChooseSerial(request));
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<Metavision::Device> device, OpenDevice(request, serial));
  auto* const stream = device->get_facility<Metavision::I_EventsStream>();
  if (stream == nullptr) return NotOffered("it has no stream of events");
  RIGCAL_ASSIGN_OR_RETURN(MetavisionIdentity identity, Identify(*device));
  identity.opened_as = serial;
  RIGCAL_ASSIGN_OR_RETURN(identity.trigger_inputs, ApplyMetavisionSettings(*device, request));
  return std::make_unique<HalDevice>(std::move(device), stream, std::move(identity));
}

}  // namespace

absl::StatusOr<std::vector<std::string>> FindMetavisionDevices() {
  std::vector<std::string> found;
  RIGCAL_RETURN_IF_ERROR(WithoutExceptions("cannot look for event cameras", [&] {
    for (const std::string& serial : Metavision::DeviceDiscovery::list()) found.push_back(serial);
  }));
  return found;
}

absl::StatusOr<std::unique_ptr<MetavisionDevice>> OpenMetavisionDevice(
    const MetavisionRequest& request) {
  absl::StatusOr<std::unique_ptr<MetavisionDevice>> device = absl::UnknownError("");
  const absl::Status thrown =
      WithoutExceptions("cannot set it up", [&] { device = Open(request); });
  return OfCamera(request.camera, thrown.ok() ? std::move(device) : thrown);
}

}  // namespace rigcal::agent
