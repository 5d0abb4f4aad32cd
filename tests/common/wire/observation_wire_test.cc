// SPDX-License-Identifier: Apache-2.0
#include "common/wire/observation_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::wire::observation_wire_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

ObservationBatch TwoRows() {
  ObservationBatch batch;
  batch.stream = {"s-1", "cam", 3};
  batch.first_seq = 17;
  batch.clock_epoch = 1;
  batch.marker_count = 3;
  for (int row = 0; row < 2; ++row) {
    Observation observation;
    observation.time_ns = 1'000'000'000 + row * 20'000'000;
    observation.clock_epoch = 1;
    for (int m = 0; m < 3; ++m) {
      MarkerObservation marker;
      marker.visible = row == 0 || m != 1;
      if (marker.visible) {
        marker.centre_px = {100.5 + m, 200.25 + row};
        marker.covariance_px2 << 0.25, 0.125, 0.125, 0.5;
        marker.time_delta_ns = -1000 * m;
        marker.label_confidence = 0.75;
        marker.centre_kind = CentreKind::kSphereCentre;
      }
      observation.markers.push_back(marker);
    }
    batch.Append(observation);
  }
  batch.clock_samples.push_back({1, 2, 3, 4});
  batch.clock_samples.push_back({.device_ns = 8, .light = 5, .light_ns = 9});
  batch.host_alignments.push_back({5, -6, 7});
  batch.dropped.push_back({40, 2, RefusalReason::kSpoolFreed});
  return batch;
}

v1::ObservationBatch TwoRowsProto() {
  v1::ObservationBatch proto;
  ToProto(TwoRows(), &proto);
  return proto;
}

TEST(ObservationWire, KeepsEveryColumn) {
  const ObservationBatch batch = TwoRows();
  ASSERT_OK_AND_ASSIGN(const ObservationBatch back, FromProto(TwoRowsProto()));
  EXPECT_EQ(back.stream, batch.stream);
  EXPECT_EQ(back.first_seq, batch.first_seq);
  EXPECT_EQ(back.clock_epoch, batch.clock_epoch);
  EXPECT_EQ(back.marker_count, batch.marker_count);
  EXPECT_EQ(back.time_ns, batch.time_ns);
  EXPECT_EQ(back.visible_mask, batch.visible_mask);
  EXPECT_EQ(back.x_px, batch.x_px);
  EXPECT_EQ(back.y_px, batch.y_px);
  EXPECT_EQ(back.cov_xx_px2, batch.cov_xx_px2);
  EXPECT_EQ(back.cov_xy_px2, batch.cov_xy_px2);
  EXPECT_EQ(back.cov_yy_px2, batch.cov_yy_px2);
  EXPECT_EQ(back.time_delta_ns, batch.time_delta_ns);
  EXPECT_EQ(back.centre_kind, batch.centre_kind);
  EXPECT_EQ(back.clock_samples, batch.clock_samples);
  EXPECT_EQ(back.host_alignments, batch.host_alignments);
  EXPECT_EQ(back.dropped, batch.dropped);
}

TEST(ObservationWire, FillsColumnsThatMayBeLeftOut) {
  v1::ObservationBatch proto = TwoRowsProto();
  proto.clear_time_delta_ns();
  proto.clear_label_confidence();
  proto.clear_centre_kind();
  proto.add_centre_kind(v1::CENTRE_KIND_IMAGE_BLOB);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, FromProto(proto));
  EXPECT_EQ(batch.Row(0).markers[2].time_delta_ns, 0);
  EXPECT_EQ(batch.Row(0).markers[2].label_confidence, 1);
  EXPECT_EQ(batch.Row(1).markers[2].centre_kind, CentreKind::kImageBlob);
}

TEST(ObservationWire, ValuesOfInvisibleMarkersBecomeZero) {
  v1::ObservationBatch proto = TwoRowsProto();
  proto.set_x_px(4, std::numeric_limits<float>::quiet_NaN());  // row 1, marker 1: not visible
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, FromProto(proto));
  EXPECT_EQ(batch.x_px[4], 0);
}

TEST(ObservationWire, ValuesPassEvenWhenTheyAreNoNumbers) {
  v1::ObservationBatch proto = TwoRowsProto();
  proto.set_x_px(0, std::numeric_limits<float>::quiet_NaN());
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, FromProto(proto));
  EXPECT_TRUE(std::isnan(batch.x_px[0]));
}

TEST(ObservationWire, AnEmptyBatchWithDroppedRangesIsWhole) {
  v1::ObservationBatch proto;
  proto.set_session_id("s-1");
  proto.set_camera("cam");
  proto.set_stream_epoch(1);
  proto.add_dropped()->set_first_seq(1);
  proto.mutable_dropped(0)->set_count(5);
  proto.mutable_dropped(0)->set_reason(v1::REFUSAL_REASON_SPOOL_FREED);
  EXPECT_THAT(FromProto(proto), IsOk());
}

struct MalformedCase {
  const char* name;
  std::function<void(v1::ObservationBatch&)> damage;
  const char* field;
};

class MalformedBatch : public ::testing::TestWithParam<MalformedCase> {};

TEST_P(MalformedBatch, IsRefusedNamingTheField) {
  v1::ObservationBatch proto = TwoRowsProto();
  GetParam().damage(proto);
  EXPECT_THAT(FromProto(proto), StatusIs(kInvalid, HasSubstr(GetParam().field)));
}

INSTANTIATE_TEST_SUITE_P(
    ObservationWire, MalformedBatch,
    ::testing::Values(
        MalformedCase{"NoSession", [](auto& p) { p.clear_session_id(); }, "session_id"},
        MalformedCase{"PathAsCamera", [](auto& p) { p.set_camera("../x"); }, "camera"},
        MalformedCase{"HugeCamera", [](auto& p) { p.set_camera(std::string(100000, 'a')); },
                      "camera"},
        MalformedCase{"NoStreamEpoch", [](auto& p) { p.clear_stream_epoch(); }, "stream_epoch"},
        MalformedCase{"SeqZero", [](auto& p) { p.set_first_seq(0); }, "first_seq"},
        MalformedCase{"SeqOverflow", [](auto& p) { p.set_first_seq(0xffffffffu); }, "first_seq"},
        MalformedCase{"NoMarkers", [](auto& p) { p.set_marker_count(0); }, "marker_count"},
        MalformedCase{"TooManyMarkers", [](auto& p) { p.set_marker_count(1u << 30); },
                      "marker_count"},
        MalformedCase{"ShortX", [](auto& p) { p.mutable_x_px()->RemoveLast(); }, "x_px"},
        MalformedCase{"LongY", [](auto& p) { p.add_y_px(1); }, "y_px"},
        MalformedCase{"ShortCovariance", [](auto& p) { p.mutable_cov_xy_px2()->RemoveLast(); },
                      "cov_xy_px2"},
        MalformedCase{"ShortMask", [](auto& p) { p.mutable_visible_mask()->RemoveLast(); },
                      "visible_mask"},
        MalformedCase{"MaskBeyondMarkers", [](auto& p) { p.set_visible_mask(1, 8); },
                      "visible_mask[1]"},
        MalformedCase{"ShortDelta", [](auto& p) { p.mutable_time_delta_ns()->RemoveLast(); },
                      "time_delta_ns"},
        MalformedCase{"UnknownCentreKind",
                      [](auto& p) { p.set_centre_kind(2, static_cast<v1::CentreKind>(77)); },
                      "centre_kind[2]"},
        MalformedCase{"UnspecifiedCentreKind",
                      [](auto& p) { p.set_centre_kind(0, v1::CENTRE_KIND_UNSPECIFIED); },
                      "centre_kind[0]"},
        MalformedCase{"DroppedOverlapsRows",
                      [](auto& p) { p.mutable_dropped(0)->set_first_seq(18); }, "dropped[0]"},
        MalformedCase{"DroppedForNoReason", [](auto& p) { p.mutable_dropped(0)->clear_reason(); },
                      "dropped[0].reason"},
        MalformedCase{"DroppedNothing", [](auto& p) { p.mutable_dropped(0)->set_count(0); },
                      "dropped[0]"}),
    [](const auto& param_info) { return std::string(param_info.param.name); });

TEST(ObservationWire, AReportKeepsItsCounts) {
  CameraReport report;
  report.stream = {"s-1", "cam", 2};
  report.observation_count = 12;
  ASSERT_OK_AND_ASSIGN(const CameraReport bare, FromProto(ToProto(report)));
  EXPECT_FALSE(bare.frames || bare.detections);

  report.frames = FrameCounts{.received = 1, .damaged = 2, .lost = 3, .reconnects = 4};
  report.detections.emplace();
  for (const DetectionOutcome outcome : kDetectionOutcomes) {
    report.detections->Add(outcome, 10 + static_cast<uint64_t>(outcome));
  }
  ASSERT_OK_AND_ASSIGN(const CameraReport back, FromProto(ToProto(report)));
  EXPECT_EQ(back.frames, report.frames);
  EXPECT_EQ(back.detections, report.detections);
}

TEST(ObservationWire, CountsDoNotWrap) {
  const v1::FrameCounts proto = ToProto(FrameCounts{.received = uint64_t{5} << 32});
  EXPECT_EQ(proto.received(), uint64_t{5} << 32);
  EXPECT_EQ(FromProto(proto).received, uint64_t{5} << 32);
  // What an agent reports can be added up for thousands of streams.
  v1::FrameCounts huge;
  huge.set_received(UINT64_MAX);
  EXPECT_EQ(FromProto(huge).received, uint64_t{1} << 40);
  Refusal refusal;
  refusal.reason = RefusalReason::kLate;
  refusal.count = uint64_t{5} << 32;
  EXPECT_EQ(ToProto(refusal).count(), UINT32_MAX);
  RefusalCounter counter;
  for (int i = 0; i < 2; ++i) counter.Add("a", RefusalReason::kLate, UINT64_MAX);
  EXPECT_EQ(counter.List().at(0).count, UINT64_MAX);
}

TEST(ObservationWire, AReasonOfANewerReleaseIsUnspecified) {
  v1::RefusalCount proto;
  proto.set_reason(static_cast<v1::RefusalReason>(9999));
  proto.set_count(3);
  EXPECT_EQ(FromProto(proto).reason, RefusalReason::kUnspecified);
  EXPECT_EQ(FromProto(proto).count, 3u);
}

TEST(ObservationWire, EndOfCaptureMustReportItsOwnStream) {
  v1::EndOfCapture end;
  end.set_session_id("s-1");
  end.set_camera("cam");
  end.set_stream_epoch(1);
  EXPECT_THAT(FromProto(end), IsOk());
  end.mutable_report()->set_session_id("s-1");
  end.mutable_report()->set_camera("other");
  end.mutable_report()->set_stream_epoch(1);
  EXPECT_THAT(FromProto(end), StatusIs(kInvalid, HasSubstr("report")));
}

}  // namespace
}  // namespace rigcal::wire::observation_wire_test
