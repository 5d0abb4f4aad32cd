// SPDX-License-Identifier: Apache-2.0
#include "common/wire/offer_wire.h"

#include <set>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(OfferedCamera::Use::kFree) == v1::OfferedCamera::USE_FREE);
static_assert(static_cast<int>(OfferedCamera::Use::kGone) == v1::OfferedCamera::USE_GONE);

constexpr int kMaxOffers = 256;
constexpr size_t kMaxOfferWord = 256;
constexpr size_t kMaxOfferNote = 1024;
constexpr size_t kMaxLensBytes = 64u << 10;

absl::Status OfferFault(absl::string_view field, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", what));
}

absl::Status CheckOfferWord(const std::string& field, const std::string& word) {
  if (word.size() > kMaxOfferWord) return OfferFault(field, "is too long");
  if (Printable(word) != word) return OfferFault(field, "has control characters");
  return absl::OkStatus();
}

std::string NoteOf(const std::string& text) { return Printable(Beginning(text, kMaxOfferNote)); }

v1::ChoiceStatus ChoiceStatusOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kOk:
      return v1::CHOICE_STATUS_OK;
    case absl::StatusCode::kNotFound:
      return v1::CHOICE_STATUS_UNKNOWN;
    case absl::StatusCode::kAlreadyExists:
      return v1::CHOICE_STATUS_TAKEN;
    case absl::StatusCode::kFailedPrecondition:
      return v1::CHOICE_STATUS_REFUSED;
    case absl::StatusCode::kInvalidArgument:
      return v1::CHOICE_STATUS_INVALID;
    default:
      return v1::CHOICE_STATUS_FAILED;
  }
}

absl::StatusCode ChoiceCode(v1::ChoiceStatus status) {
  switch (status) {
    case v1::CHOICE_STATUS_OK:
      return absl::StatusCode::kOk;
    case v1::CHOICE_STATUS_UNKNOWN:
      return absl::StatusCode::kNotFound;
    case v1::CHOICE_STATUS_TAKEN:
      return absl::StatusCode::kAlreadyExists;
    case v1::CHOICE_STATUS_REFUSED:
      return absl::StatusCode::kFailedPrecondition;
    case v1::CHOICE_STATUS_INVALID:
      return absl::StatusCode::kInvalidArgument;
    default:  // one of a newer agent has a message, too
      return absl::StatusCode::kInternal;
  }
}

}  // namespace

v1::OfferedCamera ToProto(const OfferedCamera& camera) {
  v1::OfferedCamera proto;
  proto.set_device(camera.device);
  proto.set_kind(camera.kind);
  proto.set_vendor(camera.vendor);
  proto.set_model(camera.model);
  proto.set_address(camera.address);
  proto.set_use(static_cast<v1::OfferedCamera::Use>(camera.use));
  proto.set_camera(camera.camera);
  proto.set_configured(camera.configured);
  proto.set_note(NoteOf(camera.note));
  return proto;
}

v1::OfferedCameras ToProto(const std::vector<OfferedCamera>& cameras) {
  v1::OfferedCameras proto;
  for (const OfferedCamera& camera : cameras) *proto.add_cameras() = ToProto(camera);
  return proto;
}

absl::StatusOr<std::vector<OfferedCamera>> FromProto(const v1::OfferedCameras& proto) {
  if (proto.cameras_size() > kMaxOffers) {
    return OfferFault("offer.cameras",
                      absl::StrCat("has ", proto.cameras_size(), " cameras, at most ", kMaxOffers));
  }
  std::vector<OfferedCamera> cameras;
  std::set<std::string_view> devices;
  for (int i = 0; i < proto.cameras_size(); ++i) {
    const v1::OfferedCamera& from = proto.cameras(i);
    const std::string field = absl::StrCat("offer.cameras[", i, "]");
    if (from.device().empty()) return OfferFault(field + ".device", "is empty");
    if (!devices.insert(from.device()).second) return OfferFault(field + ".device", "is repeated");
    RIGCAL_RETURN_IF_ERROR(CheckOfferWord(field + ".device", from.device()));
    RIGCAL_RETURN_IF_ERROR(CheckOfferWord(field + ".kind", from.kind()));
    RIGCAL_RETURN_IF_ERROR(CheckOfferWord(field + ".vendor", from.vendor()));
    RIGCAL_RETURN_IF_ERROR(CheckOfferWord(field + ".model", from.model()));
    RIGCAL_RETURN_IF_ERROR(CheckOfferWord(field + ".address", from.address()));
    if (!from.camera().empty()) {
      if (const absl::Status name = ValidateName("camera", from.camera()); !name.ok()) {
        return OfferFault(field + ".camera", name.message());
      }
    }
    if (!v1::OfferedCamera::Use_IsValid(from.use()) || from.use() == 0) {
      return OfferFault(field + ".use", "is not known");
    }
    cameras.push_back({.device = from.device(),
                       .kind = from.kind(),
                       .vendor = from.vendor(),
                       .model = from.model(),
                       .address = from.address(),
                       .use = static_cast<OfferedCamera::Use>(from.use()),
                       .camera = from.camera(),
                       .configured = from.configured(),
                       .note = NoteOf(from.note())});
  }
  return cameras;
}

v1::ChoiceRequest ToProto(const ChoiceRequest& request) {
  v1::ChoiceRequest proto;
  proto.set_request_id(request.request_id);
  proto.set_device(request.device);
  proto.set_camera(request.camera);
  proto.set_calibration_yaml(request.calibration_yaml);
  return proto;
}

absl::StatusOr<ChoiceRequest> FromProto(const v1::ChoiceRequest& proto) {
  if (proto.request_id() == 0) {
    return OfferFault("choice_request.request_id", "must be at least 1");
  }
  RIGCAL_RETURN_IF_ERROR(CheckOfferWord("choice_request.device", proto.device()));
  if (const absl::Status name = ValidateName("camera", proto.camera()); !name.ok()) {
    return OfferFault("choice_request.camera", name.message());
  }
  if (proto.calibration_yaml().size() > kMaxLensBytes) {
    return OfferFault("choice_request.calibration_yaml", "is larger than 64 KiB");
  }
  return ChoiceRequest{.request_id = proto.request_id(),
                       .device = proto.device(),
                       .camera = proto.camera(),
                       .calibration_yaml = proto.calibration_yaml()};
}

v1::ChoiceAnswer ToProto(const ChoiceAnswer& answer) {
  v1::ChoiceAnswer proto;
  proto.set_request_id(answer.request_id);
  proto.set_status(ChoiceStatusOf(answer.status.code()));
  if (!answer.status.ok()) proto.set_message(NoteOf(std::string(answer.status.message())));
  return proto;
}

absl::StatusOr<ChoiceAnswer> FromProto(const v1::ChoiceAnswer& proto) {
  if (proto.request_id() == 0) {
    return OfferFault("choice_answer.request_id", "must be at least 1");
  }
  return ChoiceAnswer{.request_id = proto.request_id(),
                      .status = absl::Status(ChoiceCode(proto.status()), NoteOf(proto.message()))};
}

}  // namespace rigcal::wire
