// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_append_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::EndDelivery;
using ::rigcal::testing::HasWand;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::RowKey;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class StoreAppend : public ::rigcal::testing::StoreContract {
 protected:
  void SetUp() override {
    StoreContract::SetUp();
    ASSERT_THAT(store().CreateSession(CapturingSession({"a", "b"})), IsOk());
  }
  SessionCameraCounts CountsOf(const std::string& camera) {
    const auto counts = store().GetSessionCounts("s-test");
    for (const SessionCameraCounts& candidate : *counts) {
      if (candidate.camera == camera) return candidate;
    }
    ADD_FAILURE() << "no counts of camera " << camera;
    return {};
  }
};

TEST_P(StoreAppend, StoresRowsAndCountsThem) {
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 1, 10, 3));
  EXPECT_EQ(outcome.durable_seq, 10u);
  EXPECT_EQ(outcome.stored_rows, 10u);
  EXPECT_EQ(outcome.duplicate_rows, 0u);
  EXPECT_FALSE(outcome.late || outcome.complete || outcome.unknown);
  EXPECT_EQ(ReadRows(store()).size(), 10u);
  const SessionCameraCounts counts = CountsOf("a");
  EXPECT_EQ(counts.observation_count, 10u);
  EXPECT_EQ(counts.wand_count, 8u);
  ASSERT_EQ(counts.clock_epochs.size(), 1u);
  EXPECT_EQ(counts.clock_epochs[0].clock_epoch, 3u);
  EXPECT_EQ(counts.clock_epochs[0].observation_count, 10u);
  EXPECT_EQ(CountsOf("b").observation_count, 0u);
}

TEST_P(StoreAppend, ChangesNothingForWhatIsThereHoweverLateItComes) {
  Append(MakeBatch(KeyOf("a"), 1, 10));
  Append(EndDelivery(KeyOf("a"), 10));
  const auto rows = ReadRows(store());
  const std::string counts = CountsText(store());
  for (const bool reopened : {false, true}) {
    if (reopened) Reopen();
    const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 3, 7));
    EXPECT_EQ(outcome.durable_seq, 10u);
    EXPECT_EQ(outcome.stored_rows, 0u);
    EXPECT_EQ(outcome.duplicate_rows, 5u);
    EXPECT_TRUE(outcome.complete);
    EXPECT_EQ(ReadRows(store()), rows);
    EXPECT_EQ(CountsText(store()), counts);
  }
}

TEST_P(StoreAppend, CutsWhatOverlaps) {
  Append(MakeBatch(KeyOf("a"), 4, 6));
  EXPECT_EQ(Append(MakeBatch(KeyOf("a"), 9, 10)).durable_seq, 0u);
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 1, 12));
  EXPECT_EQ(outcome.durable_seq, 12u);
  EXPECT_EQ(outcome.stored_rows, 7u);
  EXPECT_EQ(outcome.duplicate_rows, 5u);
  EXPECT_EQ(ReadRows(store()).size(), 12u);
  EXPECT_EQ(CountsOf("a").observation_count, 12u);
}

TEST_P(StoreAppend, KeepsEarlyRowsOverARestart) {
  Append(MakeBatch(KeyOf("a"), 5, 8));
  Delivery dropped = MakeDelivery(MakeBatch(KeyOf("a"), 20, 20));
  dropped.batch.dropped = {{.first_seq = 10, .count = 3, .reason = RefusalReason::kSpoolFreed}};
  Append(dropped);
  Reopen();
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 1, 15));
  EXPECT_EQ(outcome.stored_rows, 8u);  // 1 to 4, 9, 13 to 15
  EXPECT_EQ(outcome.durable_seq, 15u);
  EXPECT_EQ(CountsOf("a").observation_count, 13u);
}

TEST_P(StoreAppend, CountsSeveralDeliveriesOfOneStreamInOneTransaction) {
  const std::vector<Delivery> deliveries = {
      MakeDelivery(MakeBatch(KeyOf("a"), 1, 8)), MakeDelivery(MakeBatch(KeyOf("a"), 5, 12)),
      MakeDelivery(MakeBatch(KeyOf("b"), 1, 3)), MakeDelivery(MakeBatch(KeyOf("a"), 1, 8)),
      EndDelivery(KeyOf("a"), 12)};
  ASSERT_OK_AND_ASSIGN(const std::vector<AppendOutcome> outcomes, store().Append(deliveries));
  ASSERT_EQ(outcomes.size(), 5u);
  EXPECT_EQ(outcomes[0].stored_rows, 8u);
  EXPECT_EQ(outcomes[1].stored_rows, 4u);
  EXPECT_EQ(outcomes[1].duplicate_rows, 4u);
  EXPECT_EQ(outcomes[2].durable_seq, 3u);
  EXPECT_EQ(outcomes[3].duplicate_rows, 8u);
  EXPECT_EQ(outcomes[4].durable_seq, 12u);
  EXPECT_TRUE(outcomes[4].complete);
  EXPECT_FALSE(outcomes[3].complete);
  EXPECT_EQ(CountsOf("a").observation_count, 12u);
  EXPECT_EQ(CountsOf("b").observation_count, 3u);
}

TEST_P(StoreAppend, CountsRefusedRowsOnceAndLetsThemPass) {
  Delivery delivery = MakeDelivery(MakeBatch(KeyOf("a"), 1, 10));
  delivery.batch.x_px[3 * 3] = std::numeric_limits<float>::quiet_NaN();
  delivery.refused_rows = {
      {.row = 3, .reason = RefusalReason::kNotFinite, .detail = "the x of a marker is not finite"},
      {.row = 7, .reason = RefusalReason::kNotFinite, .detail = "the x of a marker is not finite"}};
  Append(MakeBatch(KeyOf("a"), 8, 9));  // row 7 is seq 8: already there, and not refused then
  const AppendOutcome outcome = Append(delivery);
  EXPECT_EQ(outcome.durable_seq, 10u);
  EXPECT_EQ(outcome.stored_rows, 7u);
  EXPECT_EQ(outcome.refused_rows, 1u);
  EXPECT_EQ(outcome.duplicate_rows, 2u);
  EXPECT_EQ(Append(delivery).refused_rows, 0u);

  const SessionCameraCounts counts = CountsOf("a");
  EXPECT_EQ(counts.observation_count, 9u);
  EXPECT_EQ(counts.wand_count, 7u);  // of 1 to 10: not 4 (refused), 5 and 10 (empty)
  ASSERT_EQ(counts.refused.size(), 1u);
  EXPECT_EQ(counts.refused[0], (Refusal{.camera = "a",
                                        .reason = RefusalReason::kNotFinite,
                                        .count = 1,
                                        .example = "seq 4: the x of a marker is not finite"}));
  const auto rows = ReadRows(store());
  ASSERT_EQ(rows.size(), 10u);
  for (const auto& [key, row] : rows) EXPECT_EQ(row.refused, std::get<2>(key) == 4);
}

TEST_P(StoreAppend, GivesTheLowestSeqAsExampleWhateverComesFirst) {
  for (const uint32_t seq : {7u, 2u, 9u}) {
    Delivery delivery = MakeDelivery(MakeBatch(KeyOf("a", 2), seq, seq));
    delivery.refused_rows = {{.row = 0, .reason = RefusalReason::kNotFinite, .detail = "d"}};
    Append(delivery);
  }
  Delivery older_epoch = MakeDelivery(MakeBatch(KeyOf("a", 1), 30, 30));
  older_epoch.refused_rows = {{.row = 0, .reason = RefusalReason::kNotFinite, .detail = "d"}};
  EXPECT_EQ(CountsOf("a").refused[0].example, "seq 2: d");
  Append(older_epoch);
  EXPECT_EQ(CountsOf("a").refused[0].example, "seq 30: d");
  EXPECT_EQ(CountsOf("a").refused[0].count, 4u);
}

TEST_P(StoreAppend, TakesDroppedNumbersAsArrived) {
  Delivery delivery = MakeDelivery(MakeBatch(KeyOf("a"), 1, 4));
  delivery.batch.dropped = {{.first_seq = 5, .count = 6, .reason = RefusalReason::kSpoolFreed}};
  EXPECT_EQ(Append(delivery).durable_seq, 10u);
  EXPECT_EQ(Append(delivery).durable_seq, 10u);
  // Numbers an agent gave up do not come back.
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 7, 12));
  EXPECT_EQ(outcome.stored_rows, 2u);
  EXPECT_EQ(outcome.conflict_rows, 4u);
  const SessionCameraCounts counts = CountsOf("a");
  EXPECT_EQ(counts.observation_count, 6u);
  ASSERT_EQ(counts.refused.size(), 2u);
  EXPECT_EQ(counts.refused[1].reason, RefusalReason::kConflict);
  EXPECT_EQ(counts.refused[0].reason, RefusalReason::kSpoolFreed);
  EXPECT_EQ(counts.refused[0].count, 6u);
  EXPECT_EQ(counts.refused[0].example, "seq 5: lost at the agent");
}

TEST_P(StoreAppend, MarksWhatComesAfterTheSessionFinished) {
  Append(MakeBatch(KeyOf("a"), 1, 5));
  Session session = CapturingSession({"a", "b"});
  session.state = SessionState::kFinished;
  ASSERT_THAT(store().UpdateSession(session), IsOk());
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 1, 8));
  EXPECT_TRUE(outcome.late);
  EXPECT_EQ(outcome.durable_seq, 8u);
  const SessionCameraCounts counts = CountsOf("a");
  EXPECT_EQ(counts.observation_count, 8u);
  EXPECT_EQ(counts.late_count, 3u);
  for (const auto& [key, row] : ReadRows(store())) EXPECT_EQ(row.late, std::get<2>(key) > 5);
}

TEST_P(StoreAppend, StoresNothingForUnknownSessionsAndCameras) {
  StreamKey nowhere = KeyOf("a");
  nowhere.session_id = "s-none";
  EXPECT_TRUE(Append(MakeBatch(nowhere, 1, 3)).unknown);
  EXPECT_TRUE(Append(MakeBatch(KeyOf("c"), 1, 3)).unknown);
  const std::vector<Delivery> mixed = {MakeDelivery(MakeBatch(KeyOf("c"), 1, 3)),
                                       MakeDelivery(MakeBatch(KeyOf("a"), 1, 3))};
  ASSERT_OK_AND_ASSIGN(const auto outcomes, store().Append(mixed));
  EXPECT_TRUE(outcomes[0].unknown);
  EXPECT_EQ(outcomes[1].durable_seq, 3u);
  EXPECT_THAT(store().GetStream(nowhere), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(store().GetStream(KeyOf("c")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("camera c")));
  // A camera that was unknown and is added later is not remembered as unknown.
  ASSERT_THAT(store().UpdateSession(CapturingSession({"a", "b", "c"})), IsOk());
  EXPECT_EQ(Append(MakeBatch(KeyOf("c"), 1, 3)).durable_seq, 3u);
}

TEST_P(StoreAppend, EndsWhenEverythingUpToTheEndIsThere) {
  EXPECT_FALSE(Append(EndDelivery(KeyOf("a"), 4)).complete);
  EXPECT_FALSE(Append(MakeBatch(KeyOf("a"), 2, 4)).complete);
  EXPECT_FALSE(CountsOf("a").ended());
  EXPECT_TRUE(Append(MakeBatch(KeyOf("a"), 1, 1)).complete);
  EXPECT_TRUE(CountsOf("a").ended());
  EXPECT_TRUE(Append(EndDelivery(KeyOf("b"), 0)).complete);  // not a single observation
  EXPECT_TRUE(CountsOf("b").ended());
  ASSERT_OK_AND_ASSIGN(const StreamStatus status, store().GetStream(KeyOf("a")));
  EXPECT_EQ(status.durable_seq, 4u);
  EXPECT_EQ(status.last_seq, 4u);
}

TEST_P(StoreAppend, ACameraHasEndedWhenAllItsStreamsHave) {
  Append(EndDelivery(KeyOf("a", 5), 3));
  Append(MakeBatch(KeyOf("a", 5), 1, 3));
  EXPECT_TRUE(CountsOf("a").ended());
  Append(MakeBatch(KeyOf("a", 3), 1, 3));
  EXPECT_FALSE(CountsOf("a").ended()) << "a stream of an earlier start of the agent";
  Append(EndDelivery(KeyOf("a", 3), 3));
  EXPECT_TRUE(CountsOf("a").ended());
  server::Delivery opening;
  opening.batch.stream = KeyOf("a", 2);
  opening.opens_stream = true;
  Append(opening);
  EXPECT_FALSE(CountsOf("a").ended()) << "nothing has come of it yet";
  Append(EndDelivery(KeyOf("a", 2), 0));
  Append(opening);
  EXPECT_TRUE(CountsOf("a").ended());
  const SessionCameraCounts counts = CountsOf("a");
  ASSERT_EQ(counts.streams.size(), 3u);
  EXPECT_EQ(counts.streams[2].stream_epoch, 5u);
  EXPECT_EQ(counts.streams[2].durable_seq, 3u);
  EXPECT_EQ(counts.observation_count, 6u);
}

TEST_P(StoreAppend, TellsWhereTheRowsOfEachStreamAre) {
  Append(MakeBatch(KeyOf("a", 5), 1, 30));
  Append(MakeBatch(KeyOf("a", 5), 41, 50));
  server::Delivery lost;
  lost.batch.stream = KeyOf("a", 5);
  lost.batch.dropped = {{.first_seq = 31, .count = 4, .reason = RefusalReason::kSpoolDamaged},
                        {.first_seq = 60, .count = 1, .reason = RefusalReason::kSpoolFull}};
  Append(lost);
  Append(EndDelivery(KeyOf("b", 2), 0));
  const auto report = [&](uint32_t last_seq, uint32_t acknowledged_seq, uint64_t rows) {
    server::Delivery delivery;
    delivery.batch.stream = KeyOf("a", 5);
    delivery.report.emplace().stream = KeyOf("a", 5);
    delivery.report->spool = SpoolReport{.last_seq = last_seq,
                                         .acknowledged_seq = acknowledged_seq,
                                         .spooled_count = rows,
                                         .dropped = {{"", RefusalReason::kSpoolDamaged, 4, ""}}};
    Append(delivery);
  };
  report(70, 30, 36);
  report(60, 20, 40);  // came late
  server::Delivery interrupted = EndDelivery(KeyOf("b", 3), 0);
  interrupted.report.emplace().stream = KeyOf("b", 3);
  interrupted.report->spool = SpoolReport{.end_is_unknown = true};
  Append(interrupted);
  ASSERT_OK_AND_ASSIGN(const auto audits, store().AuditStreams("s-test"));
  ASSERT_EQ(audits.size(), 3u);
  ASSERT_TRUE(audits[2].reported);
  EXPECT_TRUE(audits[2].reported->end_is_unknown);
  ASSERT_OK_AND_ASSIGN(const auto counts, store().GetSessionCounts("s-test"));
  EXPECT_FALSE(counts.at(0).streams.at(0).end_is_unknown);
  EXPECT_FALSE(counts.at(1).streams.at(0).end_is_unknown);
  EXPECT_TRUE(counts.at(1).streams.at(1).end_is_unknown);
  EXPECT_EQ(audits[0].stream, KeyOf("a", 5));
  EXPECT_EQ(audits[0].durable_seq, 34u);
  EXPECT_EQ(audits[0].highest_seq, 60u);
  EXPECT_EQ(audits[0].stored_count, 40u);
  EXPECT_EQ(audits[0].damaged_count, 0u);
  EXPECT_EQ(audits[0].absent_count,
            60u - 40u - audits[0].dropped[0].count - audits[0].dropped[1].count);
  EXPECT_FALSE(audits[0].last_seq);
  ASSERT_EQ(audits[0].dropped.size(), 2u);
  EXPECT_EQ(audits[0].dropped[0].count, 4u);
  ASSERT_TRUE(audits[0].reported);
  EXPECT_EQ(audits[0].reported->last_seq, 70u);
  EXPECT_EQ(audits[0].reported->acknowledged_seq, 30u);
  EXPECT_EQ(audits[0].reported->spooled_count, 36u);
  EXPECT_EQ(audits[0].reported->dropped.size(), 1u);
  EXPECT_EQ(audits[1].last_seq, 0u);
  EXPECT_EQ(audits[1].stored_count, 0u);
  EXPECT_FALSE(audits[1].reported);
  // Rows in the spool become fewer while the rest grows.
  report(70, 60, 10);
  EXPECT_EQ((*store().AuditStreams("s-test"))[0].reported->spooled_count, 10u);
  EXPECT_THAT(store().AuditStreams("nowhere"), StatusIs(absl::StatusCode::kNotFound, _));
}

TEST_P(StoreAppend, KeepsTheLargestReportOfEachStream) {
  const auto report = [this](uint32_t epoch, uint32_t observations, uint32_t bad_lines) {
    Delivery delivery;
    delivery.batch.stream = KeyOf("a", epoch);
    delivery.report.emplace();
    delivery.report->stream = delivery.stream();
    delivery.report->observation_count = observations;
    if (bad_lines > 0) {
      delivery.report->refused = {{.camera = "",
                                   .reason = RefusalReason::kCsvFieldCount,
                                   .count = bad_lines,
                                   .example = "line 7"}};
    }
    Append(delivery);
  };
  report(1, 10, 0);
  report(1, 20, 2);
  report(1, 10, 1);  // overtaken on its way
  report(1, 20, 2);
  ASSERT_EQ(CountsOf("a").refused.size(), 1u);
  EXPECT_EQ(CountsOf("a").refused[0], (Refusal{.camera = "a",
                                               .reason = RefusalReason::kCsvFieldCount,
                                               .count = 2,
                                               .example = "line 7"}));
  report(2, 5, 3);
  EXPECT_EQ(CountsOf("a").refused[0].count, 5u);
}

TEST_P(StoreAppend, AddsUpTheCountsOfAllStreams) {
  const auto report = [this](uint32_t epoch, uint32_t observations, uint64_t lost) {
    Delivery delivery;
    delivery.batch.stream = KeyOf("a", epoch);
    delivery.report = CameraReport{.stream = delivery.stream(), .observation_count = observations};
    delivery.report->frames = FrameCounts{.received = observations, .lost = lost};
    delivery.report->detections.emplace().Add(DetectionOutcome::kWand, observations);
    Append(delivery);
  };
  EXPECT_FALSE(CountsOf("a").frames || CountsOf("a").detections);
  report(1, 10, 2);
  report(1, 10, 5);  // no further observation, but further losses
  report(1, 10, 4);  // overtaken on its way
  EXPECT_EQ(CountsOf("a").frames, (FrameCounts{.received = 10, .lost = 5}));
  Reopen();
  report(1, 10, 5);
  report(1, 10, 4);
  report(2, 7, 1);
  EXPECT_EQ(CountsOf("a").frames, (FrameCounts{.received = 17, .lost = 6}));
  ASSERT_TRUE(CountsOf("a").detections);
  EXPECT_EQ(CountsOf("a").detections->Of(DetectionOutcome::kWand), 17u);
  EXPECT_EQ(CountsOf("a").detections->Of(DetectionOutcome::kNoWand), 0u);
  EXPECT_FALSE(CountsOf("b").frames) << "another camera";
}

TEST_P(StoreAppend, StoresClockReadingsAsASet) {
  Delivery delivery = MakeDelivery(MakeBatch(KeyOf("a"), 1, 4, 1));
  delivery.batch.clock_samples = {{.device_ns = 5, .host_monotonic_ns = 7, .host_utc_ns = 9},
                                  {.device_ns = -5, .host_monotonic_ns = 8, .host_utc_ns = 9}};
  delivery.batch.host_alignments = {{.host_monotonic_ns = 7, .server_minus_host_ns = -3}};
  Append(delivery);
  Append(delivery);
  delivery.batch = MakeBatch(KeyOf("a"), 5, 5, 1);
  delivery.batch.clock_samples = {{.device_ns = 4, .host_monotonic_ns = 6, .host_utc_ns = 8}};
  Append(delivery);

  std::vector<ClockSample> samples;
  std::vector<HostAlignment> alignments;
  const auto visit = [&](StoredBatch stored) {
    for (const auto& sample : stored.batch.clock_samples) samples.push_back(sample);
    for (const auto& alignment : stored.batch.host_alignments) alignments.push_back(alignment);
    return absl::OkStatus();
  };
  ASSERT_THAT(store().ReadObservations("s-test", "a", visit), IsOk());
  EXPECT_THAT(samples,
              ElementsAre(ClockSample{.device_ns = 4, .host_monotonic_ns = 6, .host_utc_ns = 8},
                          ClockSample{.device_ns = 5, .host_monotonic_ns = 7, .host_utc_ns = 9}));
  EXPECT_THAT(alignments,
              ElementsAre(HostAlignment{.host_monotonic_ns = 7, .server_minus_host_ns = -3}));
  ASSERT_EQ(CountsOf("a").refused.size(), 1u);
  EXPECT_EQ(CountsOf("a").refused[0].reason, RefusalReason::kImplausibleClockSample);
  EXPECT_EQ(CountsOf("a").refused[0].count, 1u);
}

TEST_P(StoreAppend, MakesNoStreamOfADeliveryThatSaysNothing) {
  Delivery delivery;
  delivery.batch.stream = KeyOf("a");
  const AppendOutcome outcome = Append(delivery);
  EXPECT_EQ(outcome.durable_seq, 0u);
  EXPECT_TRUE(CountsOf("a").streams.empty());
}

TEST_P(StoreAppend, StoresTheLastPossibleNumber) {
  EXPECT_EQ(Append(MakeBatch(KeyOf("a"), kMaxSeq - 1, kMaxSeq)).stored_rows, 2u);
  Reopen();
  EXPECT_EQ(Append(MakeBatch(KeyOf("a"), kMaxSeq - 2, kMaxSeq)).stored_rows, 1u);
  EXPECT_EQ(ReadRows(store()).size(), 3u);
}

RIGCAL_FOR_EVERY_STORE(StoreAppend);

}  // namespace
}  // namespace rigcal::server::store_append_test
