// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/metavision_hal_settings.h"

#include <metavision/hal/facilities/i_antiflicker_module.h>
#include <metavision/hal/facilities/i_camera_synchronization.h>
#include <metavision/hal/facilities/i_erc_module.h>
#include <metavision/hal/facilities/i_ll_biases.h>
#include <metavision/hal/facilities/i_trigger_in.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "absl/strings/str_join.h"
#include "agent/capture/metavision/metavision_hal_errors.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

using Channel = Metavision::I_TriggerIn::Channel;

constexpr std::array<std::pair<const char*, Channel>, 3> kInputs = {
    {{"main", Channel::Main}, {"aux", Channel::Aux}, {"loopback", Channel::Loopback}}};

absl::Status SetSync(Metavision::Device& device, EventCameraSync sync) {
  auto* const facility = device.get_facility<Metavision::I_CameraSynchronization>();
  if (facility == nullptr) {
    if (sync == EventCameraSync::kStandalone) return absl::OkStatus();
    return NotOffered("sync = \"", EventCameraSyncName(sync),
                      "\", but the camera cannot be synchronised; leave sync out");
  }
  const bool done = sync == EventCameraSync::kPrimary     ? facility->set_mode_master()
                    : sync == EventCameraSync::kSecondary ? facility->set_mode_slave()
                                                          : facility->set_mode_standalone();
  if (done) return absl::OkStatus();
  return NotOffered("the camera did not take sync = \"", EventCameraSyncName(sync), "\"");
}

std::string DescribeBiases(const std::map<std::string, int>& biases) {
  return biases.empty() ? "none" : absl::StrJoin(biases, ", ", absl::PairFormatter(" = "));
}

absl::Status SetBias(Metavision::I_LL_Biases& facility, const std::string& name, int value,
                     const std::string& camera) {
  Metavision::LL_Bias_Info info;
  if (facility.get_bias_info(name, info)) {
    const auto [lowest, highest] = info.get_bias_range();
    if (!info.is_modifiable()) {
      return NotOffered("bias ", name, " cannot be changed on this camera; leave it out");
    }
    if (value < lowest || value > highest) {
      return NotOffered("bias ", name, " is to be ", value, ", but the camera offers ", lowest,
                        " to ", highest);
    }
  }
  if (!facility.set(name, value)) {
    return NotOffered("the camera did not take bias ", name, " = ", value);
  }
  if (const int got = facility.get(name); got != value) {
    spdlog::warn("camera {}: bias {} was to be {}, the camera made it {}", camera, name, value,
                 got);
  }
  return absl::OkStatus();
}

absl::Status SetBiases(Metavision::Device& device, const MetavisionRequest& request) {
  if (request.config.biases.empty()) return absl::OkStatus();
  auto* const facility = device.get_facility<Metavision::I_LL_Biases>();
  if (facility == nullptr) {
    return NotOffered("the camera has no biases to set; leave [biases] out");
  }
  const std::map<std::string, int> known = facility->get_all_biases();
  FaultList faults;
  for (const auto& [name, value] : request.config.biases) {
    if (!known.contains(name)) {
      faults.Add("there is no bias ", name, "; the camera has: ", DescribeBiases(known));
      continue;
    }
    absl::Status status;
    status.Update(WithoutExceptions(absl::StrCat("cannot set bias ", name), [&] {
      status = SetBias(*facility, name, value, request.camera);
    }));
    faults.Add(status);
  }
  return faults.Result();
}

std::string DescribeInputs(const std::map<Channel, short>& inputs) {  // NOLINT: as the SDK has it
  std::vector<std::string> parts;
  for (const auto& [name, channel] : kInputs) {
    const auto found = inputs.find(channel);
    if (found != inputs.end())
      parts.push_back(absl::StrCat(name, " (channel ", found->second, ")"));
  }
  return parts.empty() ? "none" : absl::StrJoin(parts, ", ");
}

absl::Status EnableInput(Metavision::I_TriggerIn& facility,
                         const std::map<Channel, short>& offered,  // NOLINT
                         const std::string& name) {
  const auto* const input = std::find_if(kInputs.begin(), kInputs.end(),
                                         [&](const auto& entry) { return entry.first == name; });
  if (input == kInputs.end() || !offered.contains(input->second)) {
    return NotOffered("the camera has no trigger input ", name,
                      "; it has: ", DescribeInputs(offered));
  }
  if (facility.enable(input->second)) return absl::OkStatus();
  return NotOffered("the camera did not switch trigger input ", name,
                    " on; it has: ", DescribeInputs(offered));
}

absl::Status SetTriggerInputs(Metavision::Device& device, const MetavisionRequest& request) {
  const std::vector<std::string>& wanted = request.config.trigger_in;
  if (wanted.empty()) return absl::OkStatus();
  auto* const facility = device.get_facility<Metavision::I_TriggerIn>();
  if (facility == nullptr) {
    return NotOffered("the camera has no trigger inputs, but ", absl::StrJoin(wanted, " and "),
                      " is to be listened to");
  }
  const auto offered = facility->get_available_channels();
  bool channel_is_heard = request.trigger_channel < 0;
  for (const std::string& name : wanted) {
    RIGCAL_RETURN_IF_ERROR(EnableInput(*facility, offered, name));
    for (const auto& [input, channel] : kInputs) {
      if (name == input && offered.at(channel) == request.trigger_channel) channel_is_heard = true;
    }
  }
  if (channel_is_heard) return absl::OkStatus();
  return NotOffered("trigger_channel=", request.trigger_channel, ", but what is listened to is ",
                    absl::StrJoin(wanted, " and "), "; the camera has: ", DescribeInputs(offered));
}

absl::Status LimitEventRate(Metavision::Device& device, const MetavisionRequest& request) {
  if (!request.config.event_rate_limit) return absl::OkStatus();
  const auto limit = static_cast<uint32_t>(*request.config.event_rate_limit);
  auto* const facility = device.get_facility<Metavision::I_ErcModule>();
  if (facility == nullptr) {
    if (limit == 0) return absl::OkStatus();
    return NotOffered("the camera cannot limit its events; leave event_rate_limit out");
  }
  if (limit == 0) {
    if (facility->enable(false)) return absl::OkStatus();
    return NotOffered("the camera did not switch its limit of events off");
  }
  const uint32_t lowest = facility->get_min_supported_cd_event_rate();
  const uint32_t highest = facility->get_max_supported_cd_event_rate();
  if (limit < lowest || limit > highest) {
    return NotOffered("event_rate_limit is ", limit, " events/s, but the camera offers ", lowest,
                      " to ", highest, ", or 0 for no limit");
  }
  if (facility->set_cd_event_rate(limit) && facility->enable(true)) return absl::OkStatus();
  return NotOffered("the camera did not take event_rate_limit = ", limit);
}

}  // namespace

absl::StatusOr<std::vector<std::string>> ApplyMetavisionSettings(Metavision::Device& device,
                                                                 const MetavisionRequest& request) {
  if (request.config.sync) RIGCAL_RETURN_IF_ERROR(SetSync(device, *request.config.sync));
  RIGCAL_RETURN_IF_ERROR(SetBiases(device, request));
  RIGCAL_RETURN_IF_ERROR(SetTriggerInputs(device, request));
  RIGCAL_RETURN_IF_ERROR(LimitEventRate(device, request));
  auto* const anti_flicker = device.get_facility<Metavision::I_AntiFlickerModule>();
  if (anti_flicker != nullptr && !anti_flicker->enable(false)) {
    return NotOffered(
        "the camera did not switch its anti-flicker filter off, which would take the wand away");
  }
  return request.config.trigger_in;
}

}  // namespace rigcal::agent
