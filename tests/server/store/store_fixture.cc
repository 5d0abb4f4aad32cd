// SPDX-License-Identifier: Apache-2.0
#include "tests/server/store/store_fixture.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "server/store/factory/open_store.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {
namespace {

template <typename Value>
void AppendBytes(const Value& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

std::string RowBytes(const ObservationBatch& batch, size_t row) {
  std::string bytes;
  AppendBytes(batch.time_ns[row], &bytes);
  AppendBytes(batch.visible_mask[row], &bytes);
  for (size_t i = row * batch.marker_count; i < (row + 1) * batch.marker_count; ++i) {
    AppendBytes(batch.x_px[i], &bytes);
    AppendBytes(batch.y_px[i], &bytes);
    AppendBytes(batch.cov_xx_px2[i], &bytes);
    AppendBytes(batch.cov_xy_px2[i], &bytes);
    AppendBytes(batch.cov_yy_px2[i], &bytes);
    AppendBytes(batch.time_delta_ns[i], &bytes);
    AppendBytes(batch.label_confidence[i], &bytes);
    AppendBytes(batch.centre_kind[i], &bytes);
  }
  return bytes;
}

}  // namespace

Session CapturingSession(const std::vector<std::string>& cameras) {
  Session session;
  session.id = "s-test";
  session.rig = "rig";
  session.state = SessionState::kCapturing;
  session.target.marker_positions_m = {0, 0.13, 0.39};
  for (const std::string& name : cameras) {
    SessionCamera camera;
    camera.description.camera = name;
    camera.description.image_size_px = {.width = 1280, .height = 1024};
    camera.description.clock.clock_id = name;
    session.cameras.push_back(std::move(camera));
  }
  return session;
}

bool HasWand(uint32_t seq) { return seq % 5 != 0; }

ObservationBatch MakeBatch(const StreamKey& stream, uint32_t first_seq, uint32_t last_seq,
                           uint32_t clock_epoch) {
  ObservationBatch batch;
  batch.stream = stream;
  batch.first_seq = first_seq;
  batch.clock_epoch = clock_epoch;
  batch.marker_count = 3;
  for (uint32_t seq = first_seq; seq <= last_seq; ++seq) {
    Observation observation;
    observation.time_ns = int64_t{seq} * 10'000'000 + stream.stream_epoch;
    observation.clock_epoch = clock_epoch;
    observation.markers.resize(3);
    for (uint32_t m = 0; m < 3; ++m) {
      MarkerObservation& marker = observation.markers[m];
      marker.visible = HasWand(seq) && !(seq % 3 == 0 && m == seq % 2);
      marker.centre_px = {100.0 + 0.25 * (seq % 1000) + 40 * m, 200.0 + stream.camera.back() + m};
      marker.covariance_px2 << 0.25, 0.01 * m, 0.01 * m, 0.16;
      marker.time_delta_ns = static_cast<int32_t>(1000 * m);
      marker.label_confidence = 0.9f;
    }
    batch.Append(observation);
  }
  return batch;
}

server::Delivery MakeDelivery(ObservationBatch batch) { return {.batch = std::move(batch)}; }

server::Delivery EndDelivery(const StreamKey& stream, uint32_t last_seq) {
  server::Delivery delivery;
  delivery.batch.stream = stream;
  delivery.last_seq = last_seq;
  return delivery;
}

std::vector<std::pair<RowKey, StoredRow>> ReadRows(const server::Store& store,
                                                   std::string_view session_id) {
  std::vector<std::pair<RowKey, StoredRow>> rows;
  const auto visit = [&](server::StoredBatch stored) {
    const ObservationBatch& batch = stored.batch;
    EXPECT_EQ(batch.stream.session_id, session_id);
    for (size_t row = 0; row < batch.rows(); ++row) {
      const RowKey key{batch.stream.camera, batch.stream.stream_epoch,
                       batch.first_seq + static_cast<uint32_t>(row)};
      EXPECT_TRUE(rows.empty() || rows.back().first < key);
      rows.emplace_back(
          key, StoredRow{.clock_epoch = batch.clock_epoch,
                         .refused = !stored.refused_rows.empty() && stored.refused_rows[row],
                         .late = stored.late,
                         .bytes = RowBytes(batch, row)});
    }
    return absl::OkStatus();
  };
  EXPECT_THAT(store.ReadObservations(session_id, "", visit), IsOk());
  return rows;
}

std::string CountsText(const server::Store& store, std::string_view session_id) {
  const auto counts = store.GetSessionCounts(session_id);
  EXPECT_THAT(counts, IsOk());
  if (!counts.ok()) return "";
  std::string text;
  for (const SessionCameraCounts& camera : *counts) {
    absl::StrAppend(&text, camera.camera, ": ", camera.observation_count, " observations, ",
                    camera.wand_count, " wands, ", camera.late_count, " late\n");
    for (const ClockEpochCount& epoch : camera.clock_epochs) {
      absl::StrAppend(&text, "  clock epoch ", epoch.clock_epoch, ": ", epoch.observation_count,
                      "\n");
    }
    for (const StreamStatus& stream : camera.streams) {
      absl::StrAppend(&text, "  stream ", stream.stream_epoch, ": durable ", stream.durable_seq,
                      ", last ", stream.last_seq ? absl::StrCat(*stream.last_seq) : "none", "\n");
    }
    for (const Refusal& refusal : camera.refused) {
      absl::StrAppend(&text, "  refused ", refusal.camera, " ", std::string(NameOf(refusal.reason)),
                      ": ", refusal.count, " (", refusal.example, ")\n");
    }
  }
  return text;
}

void StoreFixture::Open() { ASSERT_OK_AND_ASSIGN(store_, server::OpenStore(folder().string())); }

server::AppendOutcome StoreFixture::Append(const server::Delivery& delivery) {
  const auto outcomes = store_->Append({&delivery, 1});
  EXPECT_THAT(outcomes, IsOk());
  if (!outcomes.ok() || outcomes->size() != 1) return {};
  return outcomes->front();
}

}  // namespace rigcal::testing
