// SPDX-License-Identifier: Apache-2.0
#include "tests/server/live/live_fixture.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {
namespace {

constexpr int64_t kBeginUtcNs = 1'800'000'000'000'000'000;
constexpr double kPeriodS = 0.02;
constexpr int kRowsPerStep = 5;

}  // namespace

void LiveFixture::SetUp() {
  options_.utc_now_ns = [this] { return kBeginUtcNs + std::llround(1e9 * now_s_); };
  SessionFixture::SetUp();
  OpenTracker();
}

void LiveFixture::OpenTracker() {
  const server::LiveTrackerOptions options{
      .utc_now_ns = options_.utc_now_ns, .steady_now = [this] {
        return std::chrono::steady_clock::time_point(
            std::chrono::nanoseconds(std::llround(1e9 * now_s_)));
      }};
  tracker_ = std::make_unique<server::LiveTracker>(options, faulty_.get(),
                                                   directory_of_agents_.get(), coordinator_.get());
}

void LiveFixture::RestartTracker() {
  tracker_.reset();
  Restart();
  OpenTracker();
}

void LiveFixture::TearDown() {
  tracker_.reset();
  SessionFixture::TearDown();
}

SessionFixture::ConnectedAgent LiveFixture::StartWave(const std::vector<std::string>& cameras,
                                                      const std::function<void(Session*)>& change) {
  ConnectedAgent agent = Connect(MakeAgent("pc", cameras));
  Session session = NewSession("wave");
  if (change) change(&session);
  EXPECT_THAT(coordinator().CreateSession(session), IsOk());
  EXPECT_THAT(coordinator().StartSession("wave"), IsOk());
  tracker_->Update();
  return agent;
}

void LiveFixture::SeeWand(double time_s, Observation* row) {
  const double x_px = 500 + 300 * std::sin(time_s);
  const double y_px = 400 + 200 * std::cos(0.7 * time_s);
  for (const double along_px : {0.0, 50.0, 150.0}) {
    MarkerObservation marker;
    marker.visible = true;
    marker.centre_px = {x_px + along_px, y_px};
    row->markers.push_back(marker);
  }
}

void LiveFixture::SeeNothing(double, Observation* row) { row->markers.resize(3); }

void LiveFixture::Send(const std::string& camera, double first_s, int rows, const MakeRow& make_row,
                       const std::function<void(server::Delivery*)>& change) {
  server::Delivery delivery;
  uint32_t& next_seq = next_seq_[{session_id_, camera}];
  if (next_seq == 0) next_seq = 1;
  delivery.batch.stream = {.session_id = session_id_, .camera = camera, .stream_epoch = 1};
  delivery.batch.first_seq = next_seq;
  delivery.batch.clock_epoch = clock_epoch_[camera];
  delivery.batch.marker_count = 3;
  for (int i = 0; i < rows; ++i) {
    const double time_s = first_s + i * kPeriodS;
    Observation row{.time_ns = std::llround(1e9 * (time_s + clock_offset_s_[camera])),
                    .clock_epoch = delivery.batch.clock_epoch,
                    .markers = {}};
    make_row(time_s, &row);
    delivery.batch.Append(row);
  }
  next_seq += static_cast<uint32_t>(rows);
  if (change) change(&delivery);
  const auto outcomes = store().Append({&delivery, 1});
  ASSERT_THAT(outcomes, IsOk());
  coordinator().RecordProgress(delivery.stream(), outcomes->front());
  tracker_->RecordDelivery(delivery, outcomes->front());
}

void LiveFixture::Wave(double duration_s, const std::map<std::string, MakeRow>& cameras) {
  const double step_s = kRowsPerStep * kPeriodS;
  for (double passed_s = 0; passed_s < duration_s - 1e-9; passed_s += step_s) {
    now_s_ += step_s;
    for (const auto& [camera, make_row] : cameras) {
      Send(camera, now_s_ - step_s, kRowsPerStep, make_row);
    }
    tracker_->Update();
  }
}

std::vector<server::LiveAlert> LiveFixture::alerts() {
  const auto now = state();
  return now->alerts.value ? *now->alerts.value : std::vector<server::LiveAlert>{};
}

std::vector<std::string> LiveFixture::AlertTexts() {
  std::vector<std::string> texts;
  for (const server::LiveAlert& alert : alerts()) {
    const char* const severity = alert.severity == server::AlertSeverity::kError     ? "error"
                                 : alert.severity == server::AlertSeverity::kWarning ? "warning"
                                                                                     : "info";
    texts.push_back(
        absl::StrCat(severity, " ", alert.kind, alert.camera.empty() ? "" : " ", alert.camera));
  }
  return texts;
}

}  // namespace rigcal::testing
