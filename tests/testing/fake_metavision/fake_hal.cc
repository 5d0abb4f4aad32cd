// SPDX-License-Identifier: Apache-2.0
// The SDK's functions, on FakeBus.
#include <memory>
#include <string>
#include <vector>

#include "metavision/hal/device/device.h"
#include "metavision/hal/device/device_discovery.h"
#include "metavision/hal/facilities/i_antiflicker_module.h"
#include "metavision/hal/facilities/i_camera_synchronization.h"
#include "metavision/hal/facilities/i_erc_module.h"
#include "metavision/hal/facilities/i_events_stream.h"
#include "metavision/hal/facilities/i_geometry.h"
#include "metavision/hal/facilities/i_hw_identification.h"
#include "metavision/hal/facilities/i_ll_biases.h"
#include "metavision/hal/facilities/i_trigger_in.h"
#include "metavision/hal/utils/hal_exception.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"

namespace Metavision {
namespace {

using rigcal::testing::FakeBias;
using rigcal::testing::FakeBus;
using rigcal::testing::FakeEventCamera;
using CameraPtr = std::shared_ptr<FakeEventCamera>;

constexpr char kIntegrator[] = "Prophesee";
constexpr char kFullSerialPrefix[] = "Prophesee:hal_plugin_prophesee:";

template <typename Facility>
class Faked : public Facility {
 public:
  explicit Faked(CameraPtr camera) : camera_(std::move(camera)) {}

 protected:
  bool Do(const std::string& function, const std::string& call) {
    if (!camera_->MayDo(function)) return false;
    camera_->calls.push_back(call);
    return true;
  }
  const CameraPtr camera_;
};

class FakeGeometry : public Faked<I_Geometry> {
 public:
  using Faked::Faked;
  int get_width() const override { return camera_->options.width; }
  int get_height() const override { return camera_->options.height; }
};

class FakeIdentification : public Faked<I_HW_Identification> {
 public:
  using Faked::Faked;
  std::string get_serial() const override {
    camera_->MayDo("I_HW_Identification::get_serial");
    return camera_->options.serial;
  }
  SensorInfo get_sensor_info() const override { return {4, 2, "IMX636"}; }
  std::vector<std::string> get_available_data_encoding_formats() const override {
    return camera_->options.formats;
  }
  std::string get_current_data_encoding_format() const override { return camera_->options.format; }
  std::string get_integrator() const override { return kIntegrator; }

 private:
  RawFileHeader get_header_impl() const override {
    RawFileHeader header;
    if (!camera_->options.header_format.empty()) {
      header.set_field("format", camera_->options.header_format);
    }
    return header;
  }
};

class FakeSynchronization : public Faked<I_CameraSynchronization> {
 public:
  using Faked::Faked;
  bool set_mode_standalone() override { return Set("set_mode_standalone"); }
  bool set_mode_master() override { return Set("set_mode_master"); }
  bool set_mode_slave() override { return Set("set_mode_slave"); }

 private:
  bool Set(const std::string& mode) { return Do("I_CameraSynchronization::" + mode, mode); }
};

class FakeBiases : public Faked<I_LL_Biases> {
 public:
  using Faked::Faked;
  bool set(const std::string& bias_name, int bias_value) override {
    FakeBias& bias = Find(bias_name);
    if (!bias.can_change || bias_value < bias.lowest || bias_value > bias.highest) {
      throw HalException(0x102001, "Invalid value for bias " + bias_name);
    }
    if (!Do("I_LL_Biases::set", bias_name)) return false;
    bias.value = bias_value;
    return true;
  }
  int get(const std::string& bias_name) override { return Find(bias_name).value; }
  bool get_bias_info(const std::string& bias_name, LL_Bias_Info& bias_info) const override {
    const FakeBias& bias = Find(bias_name);
    bias_info = LL_Bias_Info(bias.lowest, bias.highest, bias.can_change);
    return true;
  }
  std::map<std::string, int> get_all_biases() override {
    std::map<std::string, int> all;
    for (const auto& [name, bias] : camera_->options.biases) all[name] = bias.value;
    return all;
  }

 private:
  FakeBias& Find(const std::string& name) const {
    const auto found = camera_->options.biases.find(name);
    if (found == camera_->options.biases.end()) {
      throw HalException(0x102002, "Unavailable bias " + name);
    }
    return found->second;
  }
};

class FakeTriggerIn : public Faked<I_TriggerIn> {
 public:
  using Faked::Faked;
  bool enable(const Channel& channel) override {
    return Do("I_TriggerIn::enable",
              "enable input " + std::to_string(camera_->options.inputs.at(channel)));
  }
  std::map<Channel, short> get_available_channels() const override {
    return camera_->options.inputs;
  }
};

class FakeErc : public Faked<I_ErcModule> {
 public:
  using Faked::Faked;
  bool enable(bool b) override {
    if (!Do("I_ErcModule::enable", b ? "limit rate" : "no rate limit")) return false;
    if (!b) camera_->rate_limit.reset();
    return true;
  }
  bool set_cd_event_rate(uint32_t events_per_sec) override {
    if (!camera_->MayDo("I_ErcModule::set_cd_event_rate")) return false;
    camera_->rate_limit = events_per_sec;
    return true;
  }
#if FAKE_METAVISION_MAJOR >= 5
  uint32_t get_min_supported_cd_event_rate() const override { return camera_->options.lowest_rate; }
  uint32_t get_max_supported_cd_event_rate() const override {
    return camera_->options.highest_rate;
  }
#else
  uint32_t get_min_supported_cd_event_rate() override { return camera_->options.lowest_rate; }
  uint32_t get_max_supported_cd_event_rate() override { return camera_->options.highest_rate; }
#endif
};

class FakeAntiFlicker : public Faked<I_AntiFlickerModule> {
 public:
  using Faked::Faked;
  bool enable(bool b) override {
    if (!camera_->MayDo("I_AntiFlickerModule::enable")) return false;
    camera_->anti_flicker = b;
    return true;
  }
};

template <typename Facility, typename Fake>
void Hang(const CameraPtr& camera, const std::string& name, Device::Facilities* facilities) {
  if (camera->options.missing.contains(name)) return;
  (*facilities)[typeid(Facility)] = std::make_shared<Fake>(camera);
}

std::unique_ptr<Device> Open(const std::string& serial, const DeviceConfig& config) {
  FakeBus& bus = FakeBus::Get();
  bus.opened.push_back(serial);
  if (bus.absences > 0) {
    --bus.absences;
    return nullptr;
  }
  for (const CameraPtr& camera : bus.cameras) {
    const std::string& own = camera->options.serial;
    if (!serial.empty() && serial != own && serial != kFullSerialPrefix + own) continue;
    camera->NoteOpen();
    camera->MayDo("open");
    if (!config.format().empty()) camera->options.format = config.format();
    Device::Facilities facilities;
    Hang<I_Geometry, FakeGeometry>(camera, "I_Geometry", &facilities);
    Hang<I_HW_Identification, FakeIdentification>(camera, "I_HW_Identification", &facilities);
    Hang<I_EventsStream, I_EventsStream>(camera, "I_EventsStream", &facilities);
    Hang<I_CameraSynchronization, FakeSynchronization>(camera, "I_CameraSynchronization",
                                                       &facilities);
    Hang<I_LL_Biases, FakeBiases>(camera, "I_LL_Biases", &facilities);
    Hang<I_TriggerIn, FakeTriggerIn>(camera, "I_TriggerIn", &facilities);
    Hang<I_ErcModule, FakeErc>(camera, "I_ErcModule", &facilities);
    Hang<I_AntiFlickerModule, FakeAntiFlicker>(camera, "I_AntiFlickerModule", &facilities);
    return std::make_unique<Device>(std::move(facilities));
  }
  return nullptr;
}

}  // namespace

HalException::HalException(HalErrorCodeType e, const std::string& additional_info)
    : std::system_error(e, std::generic_category()),
      text_("\n-----------------------\nMetavision HAL exception\n\nError: " + additional_info +
            "\n-----------------------\n") {}

DeviceDiscovery::SerialList DeviceDiscovery::list() {
  if (FakeBus::Get().list_throws) throw HalException(0x100000, "no USB");
  SerialList serials;
  for (const CameraPtr& camera : FakeBus::Get().cameras) {
    serials.push_back(kFullSerialPrefix + camera->options.serial);
  }
  return serials;
}

#if FAKE_METAVISION_MAJOR >= 5
std::unique_ptr<Device> DeviceDiscovery::open(const std::string& serial,
                                              const DeviceConfig& config) {
  return Open(serial, config);
}
#else
std::unique_ptr<Device> DeviceDiscovery::open(const std::string& serial, DeviceConfig& config) {
  return Open(serial, config);
}
#endif

void I_EventsStream::start() { camera_->Start(); }

short I_EventsStream::poll_buffer() { return camera_->Poll(); }

#if FAKE_METAVISION_MAJOR >= 5
I_EventsStream::~I_EventsStream() = default;

void I_EventsStream::stop() { camera_->Stop(); }

DataTransfer::BufferPtr I_EventsStream::get_latest_raw_data() {
  std::vector<RawData> bytes = camera_->Take();
  if (bytes.empty()) return {};
  return DataTransfer::BufferPtr(std::make_shared<std::vector<RawData>>(std::move(bytes)));
}
#else
I_EventsStream::~I_EventsStream() { Spoil(); }

void I_EventsStream::Spoil() {
  if (returned_) returned_->assign(returned_->size(), 0xee);
}

void I_EventsStream::stop() {
  Spoil();
  camera_->Stop();
}

I_EventsStream::RawData* I_EventsStream::get_latest_raw_data(long& n_rawbytes) {
  Spoil();
  returned_ = std::make_shared<std::vector<RawData>>(camera_->Take());
  n_rawbytes = static_cast<long>(returned_->size());
  return returned_->empty() ? nullptr : returned_->data();
}
#endif

}  // namespace Metavision
