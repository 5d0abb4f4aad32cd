// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/commands/doctor_command.h"

namespace rigcal::client::connection_checks_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

ConnectionFacts With(TlsFault fault) {
  ConnectionFacts facts{.address = "10.0.0.5:7420", .has_identity = true};
  facts.probe.fault = fault;
  facts.probe.detail = "the reason";
  facts.probe.server = Certificate{.pem = "",
                                   .hosts = {"10.0.0.6", "rig.lab"},
                                   .not_before = absl::FromUnixSeconds(1'700'000'000),
                                   .not_after = absl::FromUnixSeconds(1'750'000'000)};
  return facts;
}

TEST(ExplainConnection, SaysWhatToDoAboutEveryFault) {
  for (int fault = 1; fault <= static_cast<int>(TlsFault::kBroken); ++fault) {
    const Check check = ExplainConnection(With(static_cast<TlsFault>(fault)));
    EXPECT_EQ(check.level, CheckLevel::kFail) << fault;
    EXPECT_THAT(check.message, Not(IsEmpty())) << fault;
    EXPECT_THAT(check.advice, Not(IsEmpty())) << fault;
  }
  EXPECT_EQ(ExplainConnection(With(TlsFault::kNone)).level, CheckLevel::kOk);
}

TEST(ExplainConnection, NamesWhatTheCertificateIsFor) {
  const Check check = ExplainConnection(With(TlsFault::kWrongName));
  EXPECT_THAT(check.message, AllOf(HasSubstr("10.0.0.5:7420"), HasSubstr("10.0.0.6, rig.lab")));
}

TEST(ExplainConnection, TellsAWrongClockFromAnEndedCertificate) {
  ConnectionFacts facts = With(TlsFault::kExpired);
  EXPECT_THAT(ExplainConnection(facts).message, HasSubstr("2025-06-15"));
  EXPECT_THAT(ExplainConnection(facts).advice, HasSubstr("start rigcal-server again"));
  facts.clock_ahead = absl::Hours(24 * 900);
  EXPECT_THAT(ExplainConnection(facts).message,
              HasSubstr("the clock of this PC is 900 days ahead of that of the server"));
  EXPECT_THAT(ExplainConnection(facts).advice, HasSubstr("set the clock"));
}

TEST(ExplainConnection, SaysWhyTheServerRefuses) {
  ConnectionFacts facts = With(TlsFault::kClientRefused);
  facts.renewal = absl::PermissionDeniedError("the certificate of anna was revoked");
  EXPECT_THAT(ExplainConnection(facts).message, HasSubstr("was revoked"));
  EXPECT_THAT(ExplainConnection(facts).advice, HasSubstr("rigcal login"));
  facts.renewal = absl::UnavailableError("nobody answers at 7421");
  facts.own_end = absl::UnixEpoch();
  EXPECT_THAT(ExplainConnection(facts).message,
              AllOf(HasSubstr("ended at 1970-01-01"), HasSubstr("nobody answers at 7421")));
  facts.has_identity = false;
  facts.identity_fault = absl::FailedPreconditionError("ca.crt holds 2 PEM blocks");
  EXPECT_THAT(ExplainConnection(facts).message, HasSubstr("cannot be used"));
  facts.identity_fault = absl::OkStatus();
  EXPECT_THAT(ExplainConnection(facts).message, HasSubstr("wants a certificate"));
}

TEST(CheckClock, WarnsOfAClockThatIsOff) {
  ConnectionFacts facts;
  EXPECT_FALSE(CheckClock(facts).has_value());
  facts.clock_ahead = -absl::Minutes(4);
  EXPECT_EQ(CheckClock(facts)->level, CheckLevel::kOk);
  facts.clock_ahead = -absl::Minutes(50);
  EXPECT_EQ(CheckClock(facts)->level, CheckLevel::kWarn);
  EXPECT_THAT(CheckClock(facts)->message, HasSubstr("50m behind"));
}

}  // namespace
}  // namespace rigcal::client::connection_checks_test
