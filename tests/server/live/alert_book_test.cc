// SPDX-License-Identifier: Apache-2.0
#include "server/live/alert_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::testing::alert_book_test {
namespace {

using server::AlertCondition;
using server::AlertSeverity;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class AlertBook : public ::testing::Test {
 protected:
  std::vector<server::LiveAlert> After(double step_s, std::vector<AlertCondition> conditions) {
    now_ += std::chrono::milliseconds(static_cast<int>(1000 * step_s));
    return book_.Update(std::move(conditions), now_,
                        std::chrono::nanoseconds(now_.time_since_epoch()).count());
  }
  static AlertCondition Condition(std::string camera, std::string text = "text") {
    return {.kind = "no_wand",
            .severity = AlertSeverity::kWarning,
            .camera = std::move(camera),
            .text = std::move(text)};
  }

  server::AlertBook book_;
  server::AlertBook::Time now_{std::chrono::seconds(100)};
};

TEST_F(AlertBook, ShowsWhatHasHeldForAWhile) {
  EXPECT_THAT(After(0, {Condition("a")}), IsEmpty());
  EXPECT_THAT(After(0.5, {Condition("a")}), IsEmpty());
  const auto alerts = After(0.5, {Condition("a")});
  ASSERT_THAT(alerts, SizeIs(1));
  EXPECT_EQ(alerts[0].since_utc_ns, 100'000'000'000);
}

TEST_F(AlertBook, DoesNotShowWhatComesAndGoes) {
  for (int i = 0; i < 20; ++i) {
    EXPECT_THAT(After(1.5, {Condition("a")}), IsEmpty());
    EXPECT_THAT(After(1.5, {}), IsEmpty());
  }
}

TEST_F(AlertBook, DoesNotFlicker) {
  After(0, {Condition("a")});
  After(1, {Condition("a")});
  for (int i = 0; i < 20; ++i) {
    EXPECT_THAT(After(4, {}), SizeIs(1));
    const auto alerts = After(0.5, {Condition("a")});
    ASSERT_THAT(alerts, SizeIs(1));
    EXPECT_EQ(alerts[0].since_utc_ns, 100'000'000'000);
  }
  EXPECT_THAT(After(5, {}), IsEmpty());
}

TEST_F(AlertBook, ChangesItsWordsSlowly) {
  After(0, {Condition("a", "1")});
  EXPECT_EQ(After(1, {Condition("a", "2")})[0].text, "2");
  EXPECT_EQ(After(1, {Condition("a", "3")})[0].text, "2");
  EXPECT_EQ(After(1, {Condition("a", "4")})[0].text, "4");
  // What has become worse is said at once.
  AlertCondition worse = Condition("a", "5");
  worse.severity = AlertSeverity::kError;
  EXPECT_EQ(After(0.1, {worse})[0].text, "5");
}

TEST_F(AlertBook, PutsTheWorstFirstAndHasALimit) {
  std::vector<AlertCondition> conditions;
  for (int i = 0; i < 100; ++i) conditions.push_back(Condition("camera_" + std::to_string(i)));
  conditions.back().severity = AlertSeverity::kError;
  conditions.back().camera = "z";
  After(0, conditions);
  const auto alerts = After(1, conditions);
  ASSERT_THAT(alerts, SizeIs(server::AlertBook::kMaxAlerts));
  EXPECT_EQ(alerts[0].camera, "z");
}

}  // namespace
}  // namespace rigcal::testing::alert_book_test
