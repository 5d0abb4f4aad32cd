// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/segment_format.h"

#include <gtest/gtest.h>

#include "agent/spool/disk/checkpoint.h"
#include "tests/agent/uplink/scripted_source.h"

namespace rigcal::agent::segment_format_test {
namespace {

SegmentHeader SomeHeader() {
  return {.stream_number = 3,
          .stream = {"s-1", "left", 2'000'000'000},
          .marker_count = 3,
          .begin_seq = 1,
          .first_seq = 257,
          .boot = 42};
}

TEST(SegmentFormat, GivesAHeaderBack) {
  const std::string bytes = EncodeHeader(SomeHeader());
  size_t size = 0;
  const auto header = DecodeHeader(bytes + "records", &size);
  ASSERT_TRUE(header);
  EXPECT_EQ(*header, SomeHeader());
  EXPECT_EQ(size, bytes.size());
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    EXPECT_FALSE(DecodeHeader(damaged, &size)) << "bit " << bit;
  }
  for (size_t cut = 0; cut < bytes.size(); ++cut) {
    EXPECT_FALSE(DecodeHeader(std::string_view(bytes).substr(0, cut), &size));
  }
}

TEST(SegmentFormat, GivesAnObservationBackAsFloats) {
  Observation observation = MakeObservation(-5, 9, 3);
  observation.markers[1].visible = false;
  observation.markers[2].centre_px = {1.1, 2.2};
  observation.markers[2].covariance_px2 << 0.3, 0.1, 0.1, 0.4;
  observation.markers[2].time_delta_ns = -77;
  observation.markers[2].label_confidence = 0.25f;
  observation.markers[2].centre_kind = CentreKind::kSphereCentre;
  const ClockSample sample{
      .device_ns = 1, .host_monotonic_ns = 2, .host_utc_ns = 3, .uncertainty_ns = 4};
  std::string bytes;
  const ClockSample of_wand{.device_ns = 5, .uncertainty_ns = 6, .light = 7, .light_ns = 8};
  EncodeRecord(12, observation, {of_wand, sample}, &bytes);
  const size_t size = bytes.size();
  bytes += "more";
  const auto record = RecordAtFront(bytes);
  ASSERT_TRUE(record);
  EXPECT_EQ(record->seq, 12u);
  EXPECT_EQ(record->size, size);
  SpooledObservation decoded;
  EXPECT_FALSE(DecodePayload(record->payload, 2, &decoded));
  ASSERT_TRUE(DecodePayload(record->payload, 3, &decoded));
  ASSERT_EQ(decoded.clock_samples.size(), 2u);
  EXPECT_EQ(decoded.clock_samples[0], of_wand);
  EXPECT_EQ(decoded.clock_samples[1], sample);
  // A segment of before there were lights has nothing behind the samples.
  std::string before(record->payload.substr(0, record->payload.size() - 2 * 12));
  ASSERT_TRUE(DecodePayload(before, 3, &decoded));
  EXPECT_EQ(decoded.clock_samples[1], sample);
  EXPECT_TRUE(decoded.clock_samples[0].IsOfHost());
  // What the server gets is the same as without a disk in between.
  ObservationBatch direct, read;
  for (ObservationBatch* batch : {&direct, &read}) {
    batch->clock_epoch = 9;
    batch->marker_count = 3;
  }
  direct.Append(observation);
  read.Append(decoded.observation);
  EXPECT_EQ(read.time_ns, direct.time_ns);
  EXPECT_EQ(read.visible_mask, direct.visible_mask);
  EXPECT_EQ(read.x_px, direct.x_px);
  EXPECT_EQ(read.y_px, direct.y_px);
  EXPECT_EQ(read.cov_xx_px2, direct.cov_xx_px2);
  EXPECT_EQ(read.cov_xy_px2, direct.cov_xy_px2);
  EXPECT_EQ(read.cov_yy_px2, direct.cov_yy_px2);
  EXPECT_EQ(read.time_delta_ns, direct.time_delta_ns);
  EXPECT_EQ(read.label_confidence, direct.label_confidence);
  EXPECT_EQ(read.centre_kind, direct.centre_kind);
}

TEST(SegmentFormat, GivesMoreMarkersThanAWordHasBitsBack) {
  for (const int count : {32, 33, 200}) {
    SCOPED_TRACE(count);
    Observation observation = MakeObservation(-5, 9, count);
    observation.markers[31].visible = false;
    std::string bytes;
    EncodeRecord(12, observation, {}, &bytes);
    const auto record = RecordAtFront(bytes);
    ASSERT_TRUE(record);
    SpooledObservation decoded;
    ASSERT_TRUE(DecodePayload(record->payload, static_cast<uint32_t>(count), &decoded));
    ASSERT_EQ(decoded.observation.markers.size(), observation.markers.size());
    EXPECT_EQ(decoded.observation.VisibleCount(), count - 1);
    EXPECT_FALSE(decoded.observation.markers[31].visible);
    EXPECT_EQ(decoded.observation.markers.back().time_delta_ns,
              observation.markers.back().time_delta_ns);
  }
}

TEST(SegmentFormat, SeesEveryFlippedBitOfARecord) {
  std::string bytes;
  EncodeRecord(12, MakeObservation(5, 0, 2), {}, &bytes);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    EXPECT_FALSE(RecordAtFront(damaged)) << "bit " << bit;
  }
  for (size_t cut = 0; cut < bytes.size(); ++cut) {
    const std::string_view part = std::string_view(bytes).substr(0, cut);
    EXPECT_FALSE(RecordAtFront(part));
    EXPECT_TRUE(MayContinue(part));
  }
  EXPECT_FALSE(MayContinue(bytes));
  EXPECT_FALSE(MayContinue(std::string(16, '\0')));
}

TEST(SegmentFormat, NamesSegmentsSoThatANameTellsWhatADamagedHeaderDoesNot) {
  const std::string name = FormatSegmentName({.ordinal = 12, .stream_number = 3, .first_seq = 257});
  EXPECT_EQ(name, "0000000012-000003-0000000257.seg");
  const auto parsed = ParseSegmentName(name);
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->ordinal, 12u);
  EXPECT_EQ(parsed->stream_number, 3u);
  EXPECT_EQ(parsed->first_seq, 257u);
  for (const char* text : {"", "checkpoint", "1-2.seg", "1-2-3", "1-2-0.seg", "1-0-3.seg",
                           "a-2-3.seg", "1-2-3-4.seg", "1-2-4294967295.seg"}) {
    EXPECT_FALSE(ParseSegmentName(text)) << text;
  }
}

TEST(SegmentFormat, GivesACheckpointBackAndSeesEveryFlippedBit) {
  DiskStream stream;
  stream.stream = {"s-1", "left", 5};
  stream.number = 2;
  stream.marker_count = 3;
  stream.end_seq = 101;
  stream.durable_seq = 50;
  stream.synced_seq = 90;
  stream.boot = 7;
  stream.AddGap(60, 70, RefusalReason::kSpoolFull);
  EndOfCapture& end = stream.end.emplace();
  end.stream = end.report.stream = stream.stream;
  end.last_seq = 100;
  end.report.observation_count = 100;
  end.report.refused.push_back({"", RefusalReason::kCsvBadTime, 2, "f.csv:3"});
  end.report.frames = FrameCounts{.received = 9, .damaged = 1, .lost = 2, .reconnects = 3};
  end.report.detections.emplace().Add(DetectionOutcome::kWand, 8);
  SpoolCheckpoint checkpoint{.last_stream_number = 4, .last_ordinal = 9, .streams = {stream}};
  checkpoint.streams.push_back(stream);
  checkpoint.streams.back().end.reset();
  const std::string bytes = EncodeCheckpoint(checkpoint);
  const auto back = DecodeCheckpoint(bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(EncodeCheckpoint(*back), bytes);
  ASSERT_EQ(back->streams.size(), 2u);
  const DiskStream& read = back->streams[0];
  EXPECT_EQ(read.gaps, stream.gaps);
  EXPECT_EQ(read.dropped, stream.dropped);
  EXPECT_EQ(read.row_count, 40u);
  ASSERT_TRUE(read.end);
  EXPECT_EQ(read.end->report.refused, end.report.refused);
  EXPECT_EQ(read.end->report.frames, end.report.frames);
  EXPECT_EQ(read.end->report.detections, end.report.detections);
  EXPECT_FALSE(back->streams[1].end);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    EXPECT_FALSE(DecodeCheckpoint(damaged)) << "bit " << bit;
  }
}

TEST(SegmentFormat, MergesGapsAndCountsEachNumberOnce) {
  DiskStream stream;
  stream.end_seq = 101;
  stream.CountRows();
  EXPECT_EQ(stream.AddGap(10, 20, RefusalReason::kSpoolDamaged), 10u);
  EXPECT_EQ(stream.AddGap(30, 40, RefusalReason::kSpoolFull), 10u);
  EXPECT_EQ(stream.AddGap(5, 35, RefusalReason::kSpoolDamaged), 15u);
  EXPECT_EQ(stream.AddGap(5, 40, RefusalReason::kSpoolFull), 0u);
  EXPECT_EQ(stream.gaps.size(), 2u);
  EXPECT_EQ(stream.row_count, 100u - 35);
  EXPECT_EQ(stream.dropped.at(RefusalReason::kSpoolDamaged), 25u);
  stream.SetDurable(12);
  EXPECT_EQ(stream.gaps.front(), (SpoolGap{13, 30, RefusalReason::kSpoolDamaged}));
  EXPECT_EQ(stream.row_count, 100u - 12 - 27);
  EXPECT_EQ(stream.AddGap(1, 13, RefusalReason::kSpoolDamaged), 0u) << "is acknowledged";
  stream.SetDurable(1000);
  EXPECT_EQ(stream.durable_seq, 100u);
  EXPECT_EQ(stream.row_count, 0u);
  EXPECT_TRUE(stream.gaps.empty());
}

}  // namespace
}  // namespace rigcal::agent::segment_format_test
