// SPDX-License-Identifier: Apache-2.0
#include "common/wire/offer_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::offer_wire_test {
namespace {

using ::testing::HasSubstr;

const std::vector<OfferedCamera>& Cameras() {
  using Use = OfferedCamera::Use;
  static const auto* const cameras = new std::vector<OfferedCamera>{
      {.device = "2345",
       .kind = "aravis",
       .vendor = "FLIR",
       .model = "Blackfly",
       .address = "10.0.0.2",
       .use = Use::kTakesPart,
       .camera = "left",
       .configured = true},
      {.device = "2346", .kind = "aravis", .use = Use::kBusy, .note = "in use"},
      {.device = "2347", .kind = "aravis", .use = Use::kNoPermission, .note = "udev"},
      {.device = "2348", .kind = "aravis", .use = Use::kGone, .camera = "top"},
      {.device = "2349", .kind = "sim"}};
  return *cameras;
}

template <typename Message>
void Refused(const Message& message, const std::string& what) {
  EXPECT_THAT(wire::FromProto(message),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(what)));
}

TEST(OfferWire, BringsOffersAcross) {
  ASSERT_OK_AND_ASSIGN(const auto same, wire::FromProto(wire::ToProto(Cameras())));
  EXPECT_EQ(same, Cameras());
  ASSERT_OK_AND_ASSIGN(const auto none, wire::FromProto(v1::OfferedCameras()));
  EXPECT_TRUE(none.empty());
}

TEST(OfferWire, NamesWhatCannotBeOffered) {
  const auto with = [](auto change) {
    v1::OfferedCameras offer = wire::ToProto(Cameras());
    change(*offer.mutable_cameras(1));
    return offer;
  };
  Refused(with([](auto& camera) { camera.clear_device(); }), "offer.cameras[1].device");
  Refused(with([](auto& camera) { camera.set_device("2345"); }), "repeated");
  Refused(with([](auto& camera) { camera.set_device("a\nb"); }), "control characters");
  Refused(with([](auto& camera) { camera.set_model(std::string(257, 'm')); }),
          "offer.cameras[1].model: is too long");
  Refused(with([](auto& camera) { camera.set_camera("../x"); }), "offer.cameras[1].camera");
  Refused(with([](auto& camera) { camera.clear_use(); }), "offer.cameras[1].use");
  Refused(with([](auto& camera) { camera.set_use(static_cast<v1::OfferedCamera::Use>(99)); }),
          "offer.cameras[1].use");
  v1::OfferedCameras many;
  for (int i = 0; i < 257; ++i) {
    *many.add_cameras() = wire::ToProto(Cameras()[4]);
    many.mutable_cameras(i)->set_device(std::to_string(i));
  }
  Refused(many, "at most 256");
  // A note is for people: it is cut, and shown as text.
  ASSERT_OK_AND_ASSIGN(const auto cut, wire::FromProto(with([](auto& camera) {
                         camera.set_note("\x1b" + std::string(2000, 'n'));
                       })));
  EXPECT_LE(cut[1].note.size(), 1100u);
  EXPECT_THAT(cut[1].note, ::testing::StartsWith("\\x1bn"));
}

TEST(OfferWire, BringsChoicesAcross) {
  const ChoiceRequest request{
      .request_id = 3, .device = "2345", .camera = "left", .calibration_yaml = "%YAML:1.0"};
  ASSERT_OK_AND_ASSIGN(const ChoiceRequest same, wire::FromProto(wire::ToProto(request)));
  EXPECT_EQ(same.request_id, 3u);
  EXPECT_EQ(same.device, "2345");
  EXPECT_EQ(same.camera, "left");
  EXPECT_EQ(same.calibration_yaml, "%YAML:1.0");
  v1::ChoiceRequest bad;
  Refused(bad, "choice_request.request_id");
  bad.set_request_id(1);
  Refused(bad, "choice_request.camera");
  bad.set_camera("left");
  bad.set_device("a\x1b");
  Refused(bad, "choice_request.device");
  bad.clear_device();
  bad.set_calibration_yaml(std::string((64u << 10) + 1, 'y'));
  Refused(bad, "64 KiB");
}

TEST(OfferWire, BringsAnswersAcross) {
  for (const absl::Status& status :
       {absl::OkStatus(), absl::NotFoundError("a"), absl::AlreadyExistsError("b"),
        absl::FailedPreconditionError("c"), absl::InvalidArgumentError("d"),
        absl::InternalError("e")}) {
    ASSERT_OK_AND_ASSIGN(const ChoiceAnswer same,
                         wire::FromProto(wire::ToProto(ChoiceAnswer{4, status})));
    EXPECT_EQ(same.request_id, 4u);
    EXPECT_EQ(same.status, status);
  }
  // Any other fault of an agent is one that it could not do it.
  ASSERT_OK_AND_ASSIGN(
      const ChoiceAnswer full,
      wire::FromProto(wire::ToProto(ChoiceAnswer{5, absl::ResourceExhaustedError("full")})));
  EXPECT_EQ(full.status, absl::InternalError("full"));
  Refused(v1::ChoiceAnswer(), "choice_answer.request_id");
}

}  // namespace
}  // namespace rigcal::testing::offer_wire_test
