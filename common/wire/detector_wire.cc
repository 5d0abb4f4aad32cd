// SPDX-License-Identifier: Apache-2.0
#include "common/wire/detector_wire.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(DetectorCommand::kGet) == v1::DETECTOR_COMMAND_GET);
static_assert(static_cast<int>(DetectorCommand::kSetColour) == v1::DETECTOR_COMMAND_SET_COLOUR);
static_assert(static_cast<int>(DetectorLearning::Kind::kColour) ==
              v1::DetectorLearning::KIND_COLOUR);
static_assert(static_cast<int>(DetectorLearning::State::kFailed) ==
              v1::DetectorLearning::STATE_FAILED);

constexpr size_t kMaxDetectorMessage = 1024;

absl::Status DetectorFault(absl::string_view field, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", what));
}

// What a person reads of another program has an end.
std::string Cut(std::string text) {
  text.resize(std::min(text.size(), kMaxDetectorMessage));
  return text;
}

v1::DetectorStatus StatusOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kOk:
      return v1::DETECTOR_STATUS_OK;
    case absl::StatusCode::kNotFound:
      return v1::DETECTOR_STATUS_UNKNOWN_CAMERA;
    case absl::StatusCode::kFailedPrecondition:
      return v1::DETECTOR_STATUS_REFUSED;
    case absl::StatusCode::kInvalidArgument:
      return v1::DETECTOR_STATUS_INVALID;
    default:
      return v1::DETECTOR_STATUS_FAILED;
  }
}

absl::StatusCode DetectorCode(v1::DetectorStatus status) {
  switch (status) {
    case v1::DETECTOR_STATUS_OK:
      return absl::StatusCode::kOk;
    case v1::DETECTOR_STATUS_UNKNOWN_CAMERA:
      return absl::StatusCode::kNotFound;
    case v1::DETECTOR_STATUS_REFUSED:
      return absl::StatusCode::kFailedPrecondition;
    case v1::DETECTOR_STATUS_INVALID:
      return absl::StatusCode::kInvalidArgument;
    default:  // one of a newer agent has a message, too
      return absl::StatusCode::kInternal;
  }
}

absl::StatusOr<DetectorLearning> ParseLearning(const v1::DetectorLearning& proto) {
  if (!v1::DetectorLearning::Kind_IsValid(proto.kind()) || proto.kind() == 0) {
    return DetectorFault("detector_answer.detector.learning.kind", "is not known");
  }
  if (!v1::DetectorLearning::State_IsValid(proto.state()) || proto.state() == 0) {
    return DetectorFault("detector_answer.detector.learning.state", "is not known");
  }
  return DetectorLearning{.kind = static_cast<DetectorLearning::Kind>(proto.kind()),
                          .state = static_cast<DetectorLearning::State>(proto.state()),
                          .frame_count = proto.frame_count(),
                          .wanted_frame_count = proto.wanted_frame_count(),
                          .wand_count = proto.wand_count(),
                          .message = Cut(proto.message())};
}

}  // namespace

v1::ColourRange ToProto(const ColourRange& colour) {
  v1::ColourRange proto;
  proto.set_hue_min_deg(colour.hue_min_deg);
  proto.set_hue_max_deg(colour.hue_max_deg);
  proto.set_saturation_min(colour.saturation_min);
  proto.set_value_min(static_cast<uint32_t>(colour.value_min));
  proto.set_washed_out_min(static_cast<uint32_t>(colour.washed_out_min));
  return proto;
}

absl::StatusOr<ColourRange> FromProto(const v1::ColourRange& proto) {
  constexpr uint32_t kTooLarge = 1'000'000;  // for every field, and an int holds it
  const ColourRange colour = {
      .hue_min_deg = proto.hue_min_deg(),
      .hue_max_deg = proto.hue_max_deg(),
      .saturation_min = proto.saturation_min(),
      .value_min = static_cast<int>(std::min(proto.value_min(), kTooLarge)),
      .washed_out_min = static_cast<int>(std::min(proto.washed_out_min(), kTooLarge))};
  RIGCAL_RETURN_IF_ERROR(colour.Validate());
  return colour;
}

v1::Detector ToProto(const DetectorState& state) {
  v1::Detector proto;
  *proto.mutable_colour() = ToProto(state.colour);
  proto.set_colour_learnt(state.colour_learnt);
  proto.set_mask_learnt(state.mask_learnt);
  proto.set_ignored_pixel_count(state.ignored_pixel_count);
  proto.set_ignored_share(state.ignored_share);
  if (!state.learning) return proto;
  const DetectorLearning& learning = *state.learning;
  v1::DetectorLearning* const to = proto.mutable_learning();
  to->set_kind(static_cast<v1::DetectorLearning::Kind>(learning.kind));
  to->set_state(static_cast<v1::DetectorLearning::State>(learning.state));
  to->set_frame_count(learning.frame_count);
  to->set_wanted_frame_count(learning.wanted_frame_count);
  to->set_wand_count(learning.wand_count);
  to->set_message(Cut(learning.message));
  return proto;
}

v1::DetectorRequest ToProto(const DetectorRequest& request) {
  v1::DetectorRequest proto;
  proto.set_request_id(request.request_id);
  proto.set_camera(request.camera);
  proto.set_command(static_cast<v1::DetectorCommand>(request.command));
  proto.set_frame_count(request.frame_count);
  if (request.colour) *proto.mutable_colour() = ToProto(*request.colour);
  return proto;
}

absl::StatusOr<DetectorRequest> FromProto(const v1::DetectorRequest& proto) {
  if (proto.request_id() == 0) {
    return DetectorFault("detector_request.request_id", "must be at least 1");
  }
  if (absl::Status name = ValidateName("camera", proto.camera()); !name.ok()) {
    return DetectorFault("detector_request.camera", name.message());
  }
  if (!v1::DetectorCommand_IsValid(proto.command()) || proto.command() == 0) {
    return DetectorFault("detector_request.command", "is not known");
  }
  DetectorRequest request{.request_id = proto.request_id(),
                          .camera = proto.camera(),
                          .command = static_cast<DetectorCommand>(proto.command()),
                          .frame_count = proto.frame_count(),
                          .colour = {}};
  if (proto.has_colour()) {
    RIGCAL_ASSIGN_OR_RETURN(request.colour, FromProto(proto.colour()));
  }
  return request;
}

v1::DetectorAnswer ToProto(const DetectorAnswer& answer) {
  v1::DetectorAnswer proto;
  proto.set_request_id(answer.request_id);
  proto.set_status(StatusOf(answer.status.code()));
  if (!answer.status.ok()) {
    proto.set_message(Cut(std::string(answer.status.message())));
    return proto;
  }
  *proto.mutable_detector() = ToProto(answer.state);
  return proto;
}

absl::StatusOr<DetectorAnswer> FromProto(const v1::DetectorAnswer& proto) {
  if (proto.request_id() == 0) {
    return DetectorFault("detector_answer.request_id", "must be at least 1");
  }
  DetectorAnswer answer;
  answer.request_id = proto.request_id();
  answer.status = absl::Status(DetectorCode(proto.status()), Cut(proto.message()));
  if (!answer.status.ok()) return answer;
  const v1::Detector& detector = proto.detector();
  const absl::StatusOr<ColourRange> colour = FromProto(detector.colour());
  if (!colour.ok()) {
    return DetectorFault("detector_answer.detector.colour", colour.status().message());
  }
  if (!(detector.ignored_share() >= 0 && detector.ignored_share() <= 1)) {
    return DetectorFault("detector_answer.detector.ignored_share",
                         absl::StrCat(detector.ignored_share(), " is not within 0 to 1"));
  }
  answer.state = {.colour = *colour,
                  .colour_learnt = detector.colour_learnt(),
                  .mask_learnt = detector.mask_learnt(),
                  .ignored_pixel_count = detector.ignored_pixel_count(),
                  .ignored_share = detector.ignored_share(),
                  .learning = {}};
  if (detector.has_learning()) {
    RIGCAL_ASSIGN_OR_RETURN(answer.state.learning, ParseLearning(detector.learning()));
  }
  return answer;
}

}  // namespace rigcal::wire
