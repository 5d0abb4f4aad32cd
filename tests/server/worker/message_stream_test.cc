// SPDX-License-Identifier: Apache-2.0
#include "server/worker/message_stream.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string>

#include "rigcal/worker/v1/solve.pb.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::message_stream_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

worker::v1::SolveOutput Progress(double fraction) {
  worker::v1::SolveOutput message;
  message.mutable_progress()->set_fraction(fraction);
  return message;
}

// What a writer puts into a pipe.
std::string Written(int count) {
  std::array<int, 2> ends{};
  EXPECT_EQ(pipe2(ends.data(), O_CLOEXEC), 0);
  MessageWriter writer(ends[1]);
  for (int i = 0; i < count; ++i) EXPECT_THAT(writer.Write(Progress(0.5 + i)), IsOk());
  EXPECT_THAT(writer.Flush(), IsOk());
  close(ends[1]);
  std::string bytes(4096, '\0');
  const ssize_t size = read(ends[0], bytes.data(), bytes.size());
  close(ends[0]);
  bytes.resize(static_cast<size_t>(std::max<ssize_t>(size, 0)));
  return bytes;
}

TEST(MessageStream, GivesTheMessagesHoweverTheBytesAreCut) {
  const std::string bytes = Written(3);
  for (const size_t step : {size_t{1}, size_t{2}, size_t{5}, bytes.size()}) {
    MessageCutter cutter;
    worker::v1::SolveOutput message;
    int count = 0;
    for (size_t begin = 0; begin < bytes.size(); begin += step) {
      cutter.Add(bytes.data() + begin, std::min(step, bytes.size() - begin));
      while (true) {
        const auto complete = cutter.Next(&message);
        ASSERT_THAT(complete, IsOk());
        if (!*complete) break;
        EXPECT_EQ(message.progress().fraction(), 0.5 + count++);
      }
    }
    EXPECT_EQ(count, 3) << step;
    EXPECT_TRUE(cutter.empty());
  }
}

TEST(MessageStream, AMessageThatIsCutOffStaysInside) {
  const std::string bytes = Written(1);
  MessageCutter cutter;
  worker::v1::SolveOutput message;
  cutter.Add(bytes.data(), bytes.size() - 1);
  ASSERT_OK_AND_ASSIGN(const bool complete, cutter.Next(&message));
  EXPECT_FALSE(complete);
  EXPECT_FALSE(cutter.empty());
}

TEST(MessageStream, RefusesALengthThatNoMessageHasAndBytesThatAreNone) {
  worker::v1::SolveOutput message;
  MessageCutter cutter;
  cutter.Add("\xff\xff\xff\xff", 4);
  EXPECT_THAT(cutter.Next(&message),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("4294967295")));
  MessageCutter other;
  other.Add("\x02\x00\x00\x00\xff\xff", 6);
  EXPECT_THAT(other.Next(&message), StatusIs(absl::StatusCode::kDataLoss, HasSubstr("read")));
}

TEST(MessageStream, AFullDiskIsAnError) {
  const int full = open("/dev/full", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(full, 0);
  MessageWriter writer(full);
  EXPECT_THAT(writer.Write(Progress(1)), IsOk());
  EXPECT_THAT(writer.Flush(), StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("space")));
  close(full);
}

}  // namespace
}  // namespace rigcal::server::message_stream_test
