// SPDX-License-Identifier: Apache-2.0
// Damage of every kind in the files of a spool: at most its records are lost, and all of them are
// counted and told as dropped (P11).
#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <vector>

#include "agent/spool/disk/segment_format.h"
#include "tests/agent/spool/disk/spool_reading.h"

namespace rigcal::agent::disk_spool_corruption_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const StreamKey kLeft{"s-1", "left", 3};
constexpr uint32_t kRows = 2500;  // three segments

class DiskSpoolCorruption : public ::testing::Test {
 protected:
  DiskSpoolCorruption() {
    auto spool = OpenSpool(intact_);
    EXPECT_THAT(spool->Open(kLeft, 1, 1), IsOk());
    AppendRows(*spool, kLeft, 1, kRows);
    EXPECT_THAT(spool->Finish(kLeft, {}), IsOk());
    spool->Maintain();
    Kill(spool, intact_);
    for (const std::string& name : intact_.Names()) {
      if (name.ends_with(".seg")) segments_.push_back(name);
    }
    EXPECT_THAT(segments_, SizeIs(3));
    std::string record;
    EncodeRecord(1, MakeObservation(kRowNs), {}, &record);
    record_bytes_ = record.size();
  }

  void CopyInto(ModelFileSystem& files) const {
    for (const std::string& name : intact_.Names()) files.SetContent(name, intact_.Content(name));
  }
  // Opens the damaged copy and reads everything.
  ReadStreamRows Read(ModelFileSystem& files) {
    const auto spool = OpenSpool(files);
    ReadStreamRows read = ReadRows(*spool, kLeft, 1);
    EXPECT_EQ(read.rows.size() + read.dropped.size(), kRows);
    EXPECT_EQ(read.end_seq, kRows + 1);
    for (const auto& [seq, reason] : read.dropped) {
      EXPECT_EQ(reason, RefusalReason::kSpoolDamaged) << seq;
    }
    const auto dropped = spool->Status().dropped;
    EXPECT_EQ(dropped.empty() ? 0 : dropped[0].count, read.dropped.size());
    // The counts are the same when it is read again, and after a restart.
    EXPECT_EQ(ReadRows(*spool, kLeft, 1).dropped, read.dropped);
    EXPECT_EQ(spool->Find(kLeft)->row_count, read.rows.size());
    return read;
  }

  ModelFileSystem intact_;
  std::vector<std::string> segments_;
  size_t record_bytes_ = 0;
};

TEST_F(DiskSpoolCorruption, LosesOneRecordToAFlippedBit) {
  for (const std::string& name : segments_) {
    const std::string content = intact_.Content(name);
    size_t header_bytes = 0;
    ASSERT_TRUE(DecodeHeader(content, &header_bytes));
    for (size_t bit = 0; bit < 8 * content.size(); bit += 8 * 777 + 3) {
      SCOPED_TRACE(name + ", bit " + std::to_string(bit));
      ModelFileSystem files;
      CopyInto(files);
      std::string damaged = content;
      damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
      files.SetContent(name, damaged);
      EXPECT_THAT(Read(files).dropped, SizeIs(bit / 8 < header_bytes ? 0 : 1));
    }
  }
}

TEST_F(DiskSpoolCorruption, LosesTheLastRecordOfTheLastSegmentToAFlippedBit) {
  const std::string content = intact_.Content(segments_.back());
  for (size_t byte = content.size() - record_bytes_; byte < content.size(); ++byte) {
    SCOPED_TRACE(byte);
    ModelFileSystem files;
    CopyInto(files);
    std::string damaged = content;
    damaged[byte] = static_cast<char>(damaged[byte] ^ 0x10);
    files.SetContent(segments_.back(), damaged);
    const ReadStreamRows read = Read(files);
    EXPECT_THAT(read.dropped, SizeIs(1));
    EXPECT_TRUE(read.dropped.contains(kRows));
    // Without the checkpoint nobody else knows that there was one.
    files.Erase("checkpoint");
    EXPECT_THAT(Read(files).dropped, SizeIs(1));
  }
}

TEST_F(DiskSpoolCorruption, LosesARecordForEachOneInAPageOfZeros) {
  for (const std::string& name : segments_) {
    const std::string content = intact_.Content(name);
    for (size_t page = 0; page < content.size(); page += 4096) {
      SCOPED_TRACE(name + ", page at " + std::to_string(page));
      ModelFileSystem files;
      CopyInto(files);
      std::string damaged = content;
      const size_t size = std::min<size_t>(4096, content.size() - page);
      damaged.replace(page, size, size, '\0');
      files.SetContent(name, damaged);
      EXPECT_LE(Read(files).dropped.size(), 4096 / record_bytes_ + 2);
    }
  }
}

TEST_F(DiskSpoolCorruption, LosesWhatIsCutOff) {
  for (const std::string& name : segments_) {
    const std::string content = intact_.Content(name);
    for (size_t size = 0; size < content.size(); size += 997) {
      SCOPED_TRACE(name + ", cut to " + std::to_string(size));
      ModelFileSystem files;
      CopyInto(files);
      files.SetContent(name, content.substr(0, size));
      EXPECT_LE(Read(files).dropped.size(), (content.size() - size) / record_bytes_ + 2);
    }
    SCOPED_TRACE(name + " erased");
    ModelFileSystem files;
    CopyInto(files);
    files.Erase(name);
    EXPECT_GT(Read(files).dropped.size(), 100u);
  }
}

TEST_F(DiskSpoolCorruption, SendsEverythingAgainWithoutAGoodCheckpoint) {
  const std::string content = intact_.Content("checkpoint");
  std::vector<std::string> damaged = {"", "x", std::string(content.size(), '\0'),
                                      content.substr(0, content.size() / 2), content + "x"};
  for (size_t byte = 0; byte < content.size(); ++byte) {
    damaged.push_back(content);
    damaged.back()[byte] = static_cast<char>(damaged.back()[byte] ^ 4);
  }
  for (const std::string& checkpoint : damaged) {
    ModelFileSystem files;
    CopyInto(files);
    files.SetContent("checkpoint", checkpoint);
    EXPECT_THAT(Read(files).dropped, IsEmpty());
  }
  ModelFileSystem files;
  CopyInto(files);
  files.Erase("checkpoint");
  EXPECT_THAT(Read(files).dropped, IsEmpty());
}

TEST_F(DiskSpoolCorruption, IgnoresFilesThatAreNotItsOwn) {
  ModelFileSystem files;
  CopyInto(files);
  files.SetContent("README", "hello");
  files.SetContent("1-2-3.seg.bak", "hello");
  files.SetContent("checkpoint.new", "half of one");
  EXPECT_THAT(Read(files).dropped, IsEmpty());
  EXPECT_EQ(files.Content("README"), "hello");
}

TEST_F(DiskSpoolCorruption, CountsTheRowsOfSegmentsThatNothingNames) {
  ModelFileSystem files;
  CopyInto(files);
  files.Erase("checkpoint");
  for (const std::string& name : segments_) {
    std::string content = files.Content(name);
    content[10] = static_cast<char>(content[10] ^ 1);
    files.SetContent(name, content);
  }
  const auto spool = OpenSpool(files);
  EXPECT_THAT(spool->Streams(), IsEmpty());
  ASSERT_THAT(spool->Status().dropped, SizeIs(1));
  EXPECT_EQ(spool->Status().dropped[0].count, kRows);
  EXPECT_EQ(spool->Status().dropped[0].reason, RefusalReason::kSpoolDamaged);
}

TEST_F(DiskSpoolCorruption, IsNotConfusedByASegmentOfAnotherStream) {
  ModelFileSystem files;
  CopyInto(files);
  // As a careless copy makes it: the header does not fit the name.
  files.SetContent("0000000099-000007-0000000001.seg", intact_.Content(segments_[1]));
  const auto spool = OpenSpool(files);
  EXPECT_THAT(spool->Streams(), SizeIs(1));
  EXPECT_THAT(ReadRows(*spool, kLeft, 1).rows, SizeIs(kRows));
  EXPECT_EQ(spool->Status().dropped.size(), 1u);
}

}  // namespace
}  // namespace rigcal::agent::disk_spool_corruption_test
