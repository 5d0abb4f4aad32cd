// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/answers_choice.h"

#include <gtest/gtest.h>

#include <functional>

namespace rigcal::agent::answers_choice_test {
namespace {

constexpr double kPeriodUs = 2000;

// A sensor by whose pixels the wand is found so at each time, whatever is looked for.
using IsFound = std::function<bool(PixelAnswers answers, double time_s)>;

struct Course {
  int switches = 0, trials = 0;
  double first_switch_s = 0;
  double tried_s = 0;  // in all
};

Course Follow(AnswersChoice* choice, const IsFound& is_found, double until_s, double rate_hz = 200,
              double from_s = 0) {
  Course course;
  for (int i = 0; from_s + i / rate_hz < until_s; ++i) {
    const double time_s = from_s + i / rate_hz;
    const auto tried = choice->tried();
    if (tried) course.tried_s += 1 / rate_hz;
    const auto step =
        choice->Take(static_cast<int64_t>(1e6 * time_s), is_found(choice->used(), time_s),
                     tried && is_found(*tried, time_s));
    course.trials += step == AnswersChoice::Step::kBegin ? 1 : 0;
    if (step != AnswersChoice::Step::kSwitch) continue;
    if (course.switches++ == 0) course.first_switch_s = time_s;
  }
  return course;
}

TEST(AnswersChoice, NothingElseIsTriedWhileTheWandIsFound) {
  AnswersChoice choice(kPeriodUs);
  const Course course = Follow(
      &choice, [](PixelAnswers answers, double) { return answers == PixelAnswers::kBoth; }, 60);
  EXPECT_EQ(course.trials, 0);
  EXPECT_EQ(choice.used(), PixelAnswers::kBoth);
}

TEST(AnswersChoice, WhatFindsTheWandIsUsedWithinHalfASecond) {
  for (const PixelAnswers answered : {PixelAnswers::kRise, PixelAnswers::kFall}) {
    for (const double rate_hz : {50.0, 200.0, 1000.0}) {
      AnswersChoice choice(kPeriodUs);
      const Course course = Follow(
          &choice, [&](PixelAnswers answers, double) { return answers == answered; }, 5, rate_hz);
      EXPECT_EQ(choice.used(), answered);
      EXPECT_EQ(course.switches, 1);
      EXPECT_LT(course.first_switch_s, rate_hz == 50 ? 1.0 : 0.5);
    }
  }
}

// As pixels do whose refractory period is about as long as the light is off.
TEST(AnswersChoice, AWandThatIsFoundInPartIsFoundWithOneSwitch) {
  AnswersChoice choice(kPeriodUs);
  int count = 0;
  Follow(
      &choice,
      [&](PixelAnswers answers, double) {
        return answers == PixelAnswers::kFall || (answers == PixelAnswers::kBoth && ++count % 2);
      },
      5);
  EXPECT_EQ(choice.used(), PixelAnswers::kFall);
}

TEST(AnswersChoice, WithoutAWandTrialsAreATenthOfTheTime) {
  AnswersChoice choice(kPeriodUs);
  const Course course = Follow(
      &choice, [](PixelAnswers, double) { return false; }, 100);
  EXPECT_EQ(course.switches, 0);
  EXPECT_GT(course.trials, 50);
  EXPECT_LT(course.tried_s, 10);
}

// Pixels that answer both switches answer each of them: whenever the wand comes, a trial then
// must not win.
TEST(AnswersChoice, AWandThatComesDuringATrialIsFoundByBoth) {
  for (double comes_s = 0; comes_s < 1; comes_s += 0.01) {
    AnswersChoice choice(kPeriodUs);
    const Course course = Follow(
        &choice, [&](PixelAnswers, double time_s) { return time_s > comes_s; }, 3);
    EXPECT_EQ(course.switches, 0) << comes_s;
  }
}

TEST(AnswersChoice, AnotherWandWhoseLightIsAnsweredOtherwiseIsFoundToo) {
  AnswersChoice choice(kPeriodUs);
  const auto only = [](PixelAnswers answered) {
    return [answered](PixelAnswers answers, double) { return answers == answered; };
  };
  Follow(&choice, only(PixelAnswers::kFall), 5);
  Follow(&choice, only(PixelAnswers::kBoth), 10, 200, 5);
  EXPECT_EQ(choice.used(), PixelAnswers::kBoth);
}

TEST(AnswersChoice, AClockThatBeginsAnewEndsTheTrialAndKeepsWhatIsUsed) {
  AnswersChoice choice(kPeriodUs);
  Follow(
      &choice, [](PixelAnswers answers, double) { return answers == PixelAnswers::kRise; }, 5);
  for (int i = 0; !choice.tried(); ++i) choice.Take(5'000'000 + 5000 * i, false, false);
  choice.Restart();
  EXPECT_FALSE(choice.tried());
  EXPECT_EQ(choice.used(), PixelAnswers::kRise);
  const Course course = Follow(
      &choice, [](PixelAnswers, double) { return true; }, 5);
  EXPECT_EQ(course.trials, 0);
}

}  // namespace
}  // namespace rigcal::agent::answers_choice_test
