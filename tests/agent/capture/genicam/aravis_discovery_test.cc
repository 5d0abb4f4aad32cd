// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_discovery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::aravis_discovery_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

// An acknowledgement as GigE Vision describes it.
std::string Answer() {
  std::string packet(8 + 0xf8, '\0');
  packet[3] = 3;
  packet[5] = static_cast<char>(0xf8);
  const auto put = [&](size_t offset, const std::string& text) {
    packet.replace(8 + offset, text.size(), text);
  };
  put(0x24, std::string("\xc0\xa8\x01\x05", 4));
  put(0x48, "Basler");
  put(0x68, "acA1300-75gc");
  put(0xd8, "21876543");
  return packet;
}

TEST(ParseDiscoveryAnswer, NamesTheCameraAsAravisDoes) {
  ASSERT_OK_AND_ASSIGN(const FoundCamera camera, ParseDiscoveryAnswer(Answer()));
  EXPECT_EQ(camera.id, "Basler-21876543");
  EXPECT_EQ(camera.model, "acA1300-75gc");
  EXPECT_EQ(camera.serial, "21876543");
  EXPECT_EQ(camera.address, "192.168.1.5");
  EXPECT_EQ(DescribeCameras({camera}), "Basler-21876543 (acA1300-75gc, 192.168.1.5)");
}

TEST(ParseDiscoveryAnswer, TakesFieldsWithoutEnd) {
  std::string packet = Answer();
  packet.replace(8 + 0xd8, 16, "0123456789abcdef");
  ASSERT_OK_AND_ASSIGN(const FoundCamera camera, ParseDiscoveryAnswer(packet));
  EXPECT_EQ(camera.serial, "0123456789abcdef");
}

TEST(ParseDiscoveryAnswer, RefusesWhatIsNotOne) {
  const std::string whole = Answer();
  for (size_t size = 0; size < whole.size(); ++size) {
    EXPECT_THAT(ParseDiscoveryAnswer(std::string_view(whole).substr(0, size)),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("256 bytes")));
  }
  for (size_t i = 0; i < 4; ++i) {
    std::string other = whole;
    other[i] = static_cast<char>(other[i] + 1);
    EXPECT_THAT(ParseDiscoveryAnswer(other),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("acknowledgement")));
  }
}

TEST(FoundCamera, IsNamedByIdSerialOrAddress) {
  ASSERT_OK_AND_ASSIGN(const FoundCamera camera, ParseDiscoveryAnswer(Answer()));
  EXPECT_TRUE(camera.IsNamed("Basler-21876543"));
  EXPECT_TRUE(camera.IsNamed("21876543"));
  EXPECT_TRUE(camera.IsNamed("192.168.1.5"));
  EXPECT_FALSE(camera.IsNamed("2187654"));
  EXPECT_FALSE(camera.IsNamed(""));
  EXPECT_FALSE(FoundCamera{}.IsNamed(""));
}

TEST(DescribeCameras, SaysWhenThereAreNone) {
  EXPECT_EQ(DescribeCameras({}), "none");
  EXPECT_EQ(
      DescribeCameras({{"A-1", "m", "1", "", "USB3Vision"}, {"B-2", "n", "2", "10.0.0.1", ""}}),
      "A-1 (m); B-2 (n, 10.0.0.1)");
}

TEST(IsIpv4Address, WantsFourNumbers) {
  EXPECT_TRUE(IsIpv4Address("127.0.0.1"));
  EXPECT_FALSE(IsIpv4Address("127.0.0"));
  EXPECT_FALSE(IsIpv4Address("127.0.0.256"));
  EXPECT_FALSE(IsIpv4Address("localhost"));
  EXPECT_FALSE(IsIpv4Address("Basler-21876543"));
  EXPECT_FALSE(IsIpv4Address(""));
}

TEST(LocalAddressFor, FindsTheInterfaceOfANetwork) {
  ASSERT_OK_AND_ASSIGN(const std::string any, LocalAddressFor("127.0.0.77", ""));
  EXPECT_EQ(any, "127.0.0.1");
  ASSERT_OK_AND_ASSIGN(const std::string named, LocalAddressFor("127.0.0.77", "lo"));
  EXPECT_EQ(named, "127.0.0.1");
}

TEST(LocalAddressFor, SaysWhatThereIs) {
  EXPECT_THAT(LocalAddressFor("127.0.0.1", "no_such_card"),
              StatusIs(absl::StatusCode::kNotFound,
                       ::testing::AllOf(HasSubstr("no_such_card"), HasSubstr("lo"))));
  EXPECT_THAT(LocalAddressFor("240.1.2.3", "lo"),
              StatusIs(absl::StatusCode::kNotFound,
                       ::testing::AllOf(HasSubstr("240.1.2.3"), HasSubstr("lo 127.0.0.1"))));
  EXPECT_THAT(LocalAddressFor("left", ""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left")));
}

TEST(AskCamera, NobodyThereIsNoError) {
  ASSERT_OK_AND_ASSIGN(const auto answer,
                       AskCamera("127.0.0.77", "lo", std::chrono::milliseconds(200)));
  EXPECT_FALSE(answer.has_value());
}

TEST(FindCameras, RefusesAnInterfaceThatIsNotThere) {
  EXPECT_THAT(FindCameras("no_such_card"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no_such_card")));
}

}  // namespace
}  // namespace rigcal::agent::aravis_discovery_test
