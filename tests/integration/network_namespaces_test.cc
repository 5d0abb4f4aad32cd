// SPDX-License-Identifier: Apache-2.0
// deploy/demo-network.sh: PCs in network namespaces, joined over TLS, whose links the kernel breaks
// (T3). RIGCAL_OUTAGE_SECONDS=60: for so long.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "tests/testing/process.h"

namespace rigcal::testing::network_namespaces_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

constexpr char kScript[] = RIGCAL_SOURCE_DIR "/deploy/demo-network.sh";

// The recording is three times as long. In less than 15 s the wand sees too little of the volume
// for a calibration that is always acceptable.
int OutageSeconds() {
  const char* asked = std::getenv("RIGCAL_OUTAGE_SECONDS");
  return asked == nullptr ? 5 : std::max(1, std::atoi(asked));
}

std::unique_ptr<Process> StartDemo(const std::string& fault) {
  return std::make_unique<Process>(
      Process::Options{{kScript, fault},
                       {{"RIGCAL_DEMO_PROGRAMS", RIGCAL_BIN_DIR},
                        {"RIGCAL_DEMO_SECONDS", std::to_string(3 * OutageSeconds())}}});
}

// The last line that begins so.
std::string LastLine(const std::string& text, const std::string& beginning) {
  const size_t at = text.rfind("\n" + beginning);
  return at == std::string::npos ? "" : text.substr(at + 1, text.find('\n', at + 1) - at - 1);
}

// All at once, as each has a network of its own.
TEST(NetworkNamespaces, NothingIsLostWhateverTheLinkDoes) {
  const std::vector<std::string> faults = {"cut", "one-way", "loss"};
  std::vector<std::unique_ptr<Process>> demos;
  for (const std::string& fault : faults) demos.push_back(StartDemo(fault));
  std::string skipped;
  for (size_t i = 0; i < faults.size(); ++i) {
    SCOPED_TRACE(faults[i]);
    ASSERT_EQ(demos[i]->Wait(std::chrono::seconds(100 + 4 * OutageSeconds())), 0)
        << demos[i]->StandardOutput() << demos[i]->StandardError();
    const std::string output = demos[i]->StandardOutput();
    if (output.find("skipped: ") == 0) {
      skipped += faults[i] + " " + output;
      continue;
    }
    SCOPED_TRACE(output);
    const std::string verified = LastLine(output, "verified: ");
    std::printf("%-8s %s\n", faults[i].c_str(), verified.c_str());
    EXPECT_THAT(verified,
                MatchesRegex("verified: [0-9]{3,} detected = [0-9]{3,} durable and readable [+] 0 "
                             "damaged [+] 0 spooled [+] 0 dropped"));
    EXPECT_THAT(output, AllOf(HasSubstr("rk1."), HasSubstr("has joined the server at 192.168."),
                              HasSubstr("): succeeded")));
    // In the middle of the wave it is not, and after it nothing else is said.
    const std::string after = output.substr(output.find("Nothing is lost"));
    EXPECT_THAT(after, Not(HasSubstr("not verified")));
    EXPECT_THAT(output, HasSubstr("not verified: session wave is still capturing"));
  }
  if (!skipped.empty()) GTEST_SKIP() << skipped;
}

// F1: who answers in the server's place is shown nothing, whatever he shows as the CA.
TEST(NetworkNamespaces, AnImpostorLearnsNothing) {
  const auto demo = StartDemo("impostor");
  ASSERT_EQ(demo->Wait(std::chrono::seconds(180)), 0)
      << demo->StandardOutput() << demo->StandardError();
  const std::string output = demo->StandardOutput();
  if (output.find("skipped: ") == 0) GTEST_SKIP() << output;
  EXPECT_THAT(output, AllOf(HasSubstr("the impostor has seen no secret"),
                            HasSubstr("holds 2 PEM blocks"), HasSubstr("holds 3 PEM blocks"),
                            HasSubstr("agent camera-pc-2 has joined the server at 192.168.77.10"),
                            HasSubstr("ca.crt holds 2 PEM blocks"), HasSubstr("was revoked")));
}

TEST(NetworkNamespaces, AnUnknownFaultIsRefused) {
  const auto demo = StartDemo("fog");
  EXPECT_EQ(demo->Wait(), 2);
  EXPECT_THAT(demo->StandardError(), AllOf(HasSubstr("'fog'"), HasSubstr("one-way")));
}

}  // namespace
}  // namespace rigcal::testing::network_namespaces_test
