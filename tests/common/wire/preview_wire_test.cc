// SPDX-License-Identifier: Apache-2.0
#include "common/wire/preview_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::wire::preview_wire_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

Preview MakePreview() {
  Preview preview;
  preview.request_id = 9;
  preview.info = {.camera = "left",
                  .time_ns = -5,
                  .clock_epoch = 3,
                  .image_size_px = {1280, 1024},
                  .jpeg_size_px = {640, 512},
                  .outcome = DetectionOutcome::kSaturated,
                  .confidence = 0.5,
                  .visible_marker_count = 2,
                  .blob_count = 40,
                  .tracked = true};
  preview.jpeg = std::string("\xff\xd8\0x", 4);
  return preview;
}

TEST(PreviewWire, KeepsThePictureAndWhatItShows) {
  const v1::Preview proto = ToProto(MakePreview());
  EXPECT_EQ(proto.info().jpeg_bytes(), 4u);
  EXPECT_EQ(proto.info().outcome(), v1::DETECTION_OUTCOME_SATURATED);
  ASSERT_OK_AND_ASSIGN(const Preview back, FromProto(proto));
  EXPECT_EQ(back.request_id, 9u);
  EXPECT_EQ(back.status, PreviewStatus::kOk);
  EXPECT_EQ(back.info, MakePreview().info);
  EXPECT_EQ(back.jpeg, MakePreview().jpeg);
}

TEST(PreviewWire, ARefusalCarriesNoPicture) {
  Preview refused = MakePreview();
  refused.status = PreviewStatus::kNotCapturing;
  refused.message = std::string(5000, 'm');
  const v1::Preview proto = ToProto(refused);
  EXPECT_TRUE(proto.jpeg().empty());
  EXPECT_FALSE(proto.has_info());
  ASSERT_OK_AND_ASSIGN(const Preview back, FromProto(proto));
  EXPECT_EQ(back.status, PreviewStatus::kNotCapturing);
  EXPECT_EQ(back.message, std::string(1024, 'm'));
}

TEST(PreviewWire, AReasonOfANewerAgentIsAFailureWithItsMessage) {
  v1::Preview proto;
  proto.set_request_id(1);
  proto.set_status(static_cast<v1::PreviewStatus>(77));
  proto.set_message("the moon is in the way");
  ASSERT_OK_AND_ASSIGN(const Preview back, FromProto(proto));
  EXPECT_EQ(back.status, PreviewStatus::kFailed);
  EXPECT_EQ(back.message, "the moon is in the way");
  // A status that was not set is not taken for an image.
  proto.clear_status();
  ASSERT_OK_AND_ASSIGN(const Preview unset, FromProto(proto));
  EXPECT_EQ(unset.status, PreviewStatus::kFailed);
}

struct MalformedPreview {
  const char* name;
  std::function<void(v1::Preview&)> spoil;
  const char* field;
};

class MalformedPreviewTest : public ::testing::TestWithParam<MalformedPreview> {};

TEST_P(MalformedPreviewTest, IsRefusedNamingTheField) {
  v1::Preview proto = ToProto(MakePreview());
  GetParam().spoil(proto);
  EXPECT_THAT(FromProto(proto), StatusIs(kInvalid, HasSubstr(GetParam().field)));
}

INSTANTIATE_TEST_SUITE_P(
    PreviewWire, MalformedPreviewTest,
    ::testing::Values(
        MalformedPreview{"NoId", [](auto& p) { p.clear_request_id(); }, "request_id"},
        MalformedPreview{"NoInfo", [](auto& p) { p.clear_info(); }, "info.camera"},
        MalformedPreview{"BadName", [](auto& p) { p.mutable_info()->set_camera("a/../b"); },
                         "info.camera"},
        MalformedPreview{"NoOutcome", [](auto& p) { p.mutable_info()->clear_outcome(); },
                         "info.outcome"},
        MalformedPreview{
            "UnknownOutcome",
            [](auto& p) { p.mutable_info()->set_outcome(static_cast<v1::DetectionOutcome>(50)); },
            "info.outcome"},
        MalformedPreview{"NanConfidence",
                         [](auto& p) { p.mutable_info()->set_confidence(std::nan("")); },
                         "info.confidence"},
        MalformedPreview{"NoPicture", [](auto& p) { p.clear_jpeg(); }, "jpeg"},
        MalformedPreview{"HugePicture",
                         [](auto& p) { p.set_jpeg(std::string(kMaxPreviewBytes + 1, 'j')); },
                         "jpeg"}),
    [](const auto& param_info) { return std::string(param_info.param.name); });

TEST(PreviewWire, ARequestNamesItsCamera) {
  const PreviewRequest request{4, "left", 1000, 2000};
  ASSERT_OK_AND_ASSIGN(const PreviewRequest back, FromProto(ToProto(request)));
  EXPECT_EQ(back.request_id, 4u);
  EXPECT_EQ(back.camera, "left");
  EXPECT_EQ(back.max_jpeg_bytes, 1000u);
  EXPECT_EQ(back.max_wait_ms, 2000u);
  v1::PreviewRequest proto = ToProto(request);
  proto.clear_camera();
  EXPECT_THAT(FromProto(proto), StatusIs(kInvalid, HasSubstr("camera")));
  proto = ToProto(request);
  proto.clear_request_id();
  EXPECT_THAT(FromProto(proto), StatusIs(kInvalid, HasSubstr("request_id")));
}

}  // namespace
}  // namespace rigcal::wire::preview_wire_test
