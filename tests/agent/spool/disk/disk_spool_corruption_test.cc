// SPDX-License-Identifier: Apache-2.0
// Damage of every kind in the files of a spool: at most its records are lost, and all of them are
// counted and told as dropped (P11).
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "agent/spool/disk/segment_format.h"
#include "tests/agent/spool/disk/spool_reading.h"
#include "tests/testing/temporary_directory.h"

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

// The agent is killed while it captures: only the segments, the checkpoint and the ends say how much
// there was.
class DiskSpoolCorruptionOfACapture : public ::testing::Test {
 protected:
  DiskSpoolCorruptionOfACapture() {
    auto spool = OpenSpool(files_);
    EXPECT_THAT(spool->Open(kLeft, 1, 1), IsOk());
    spool->Maintain();
    AppendRows(*spool, kLeft, 1, kRows);
    Kill(spool, files_);
    for (const std::string& name : files_.Names()) {
      if (name.ends_with(".seg")) segments_.push_back(name);
    }
    EXPECT_THAT(segments_, SizeIs(3));
  }
  SpooledStream Recovered(DiskSpoolOptions options = ModelOptions()) {
    const auto spool = OpenSpool(files_, std::move(options));
    const auto stream = spool->Find(kLeft);
    EXPECT_TRUE(stream);
    return stream.value_or(SpooledStream());
  }
  void CutAtARecordsBorder() {
    const std::string content = files_.Content(segments_.back());
    std::string record;
    EncodeRecord(1, MakeObservation(kRowNs), {}, &record);
    files_.SetContent(segments_.back(), content.substr(0, content.size() - 100 * record.size()));
  }

  ModelFileSystem files_;
  std::vector<std::string> segments_;
};

TEST_F(DiskSpoolCorruptionOfACapture, TheEndIsKnownWhereNothingIsDamaged) {
  EXPECT_FALSE(Recovered().end_is_unknown);
  const SpooledStream stream = Recovered();
  EXPECT_FALSE(stream.end_is_unknown);
  EXPECT_EQ(stream.end_seq, kRows + 1);
  EXPECT_THAT(stream.dropped, IsEmpty());
}

TEST_F(DiskSpoolCorruptionOfACapture, CountsWhatWasCutOffAtARecordsBorder) {
  CutAtARecordsBorder();
  const SpooledStream stream = Recovered();
  EXPECT_FALSE(stream.end_is_unknown);
  EXPECT_EQ(stream.end_seq, kRows + 1);
  EXPECT_EQ(stream.dropped.at(RefusalReason::kSpoolDamaged), 100u);
}

TEST_F(DiskSpoolCorruptionOfACapture, CountsTheSegmentsThatAreGone) {
  for (const std::string& name : segments_) files_.Erase(name);
  const SpooledStream stream = Recovered();
  EXPECT_FALSE(stream.end_is_unknown);
  EXPECT_EQ(stream.dropped.at(RefusalReason::kSpoolDamaged), kRows);
}

TEST_F(DiskSpoolCorruptionOfACapture, DoesNotKnowTheEndWithoutItsProof) {
  CutAtARecordsBorder();
  const std::string ends = files_.Content("ends");
  std::vector<std::string> damaged = {"", ends.substr(0, ends.size() - 1),
                                      std::string(ends.size(), '\0')};
  for (size_t byte = 12; byte < ends.size(); ++byte) {
    damaged.push_back(ends);
    damaged.back()[byte] = static_cast<char>(damaged.back()[byte] ^ 1);
  }
  const std::string checkpoint = files_.Content("checkpoint");
  for (const std::string& content : damaged) {
    files_.SetContent("ends", content);
    files_.SetContent("checkpoint", checkpoint);
    EXPECT_TRUE(Recovered().end_is_unknown);
  }
  files_.Erase("ends");
  files_.SetContent("checkpoint", checkpoint);
  EXPECT_TRUE(Recovered().end_is_unknown);
  // And it does not become known by starting once more.
  EXPECT_TRUE(Recovered().end_is_unknown);
  EXPECT_TRUE(SpoolReportOf(Recovered()).end_is_unknown);
}

TEST_F(DiskSpoolCorruptionOfACapture, DoesNotKnowTheEndAfterAPowerCut) {
  DiskSpoolOptions options = ModelOptions();
  options.boot = 8;
  EXPECT_TRUE(Recovered(options).end_is_unknown);
}

TEST_F(DiskSpoolCorruption, KnowsTheEndOfACaptureThatHadEnded) {
  DiskSpoolOptions options = ModelOptions();
  options.boot = 8;
  const auto spool = OpenSpool(intact_, options);
  EXPECT_FALSE(spool->Find(kLeft)->end_is_unknown);
}

// On a real file system, whose files may have holes: 20 GiB that take no room.
class DiskSpoolHoles : public ::testing::Test {
 protected:
  static constexpr uintmax_t kHuge = uintmax_t{20} << 30;

  DiskSpoolOptions Options() const {
    DiskSpoolOptions options = ModelOptions();
    options.folder = (directory_.path() / "spool").string();
    return options;
  }
  void SetUp() override {
    const auto spool = DiskSpool::Create(Options());
    ASSERT_THAT(spool, IsOk());
    ASSERT_THAT((*spool)->Open(kLeft, 1, 1), IsOk());
    ASSERT_NO_FATAL_FAILURE(AppendRows(**spool, kLeft, 1, kRows));
    (*spool)->Maintain();
  }
  std::vector<std::filesystem::path> Segments() const {
    std::vector<std::filesystem::path> paths;
    for (const auto& entry : std::filesystem::directory_iterator(directory_.path() / "spool")) {
      if (entry.path().extension() == ".seg") paths.push_back(entry.path());
    }
    std::ranges::sort(paths);
    return paths;
  }
  // What is sent, and what is counted as damaged.
  ReadStreamRows Read() {
    const auto spool = DiskSpool::Create(Options());
    EXPECT_THAT(spool, IsOk());
    ReadStreamRows read = ReadRows(**spool, kLeft, 1);
    EXPECT_LT((*spool)->Status().bytes, uint64_t{64} << 20) << "what is no segment takes no room";
    const auto dropped = (*spool)->Status().dropped;
    EXPECT_EQ(dropped.empty() ? 0 : dropped[0].count, read.dropped.size());
    return read;
  }

  ::rigcal::testing::TemporaryDirectory directory_;
};

TEST_F(DiskSpoolHoles, ALastSegmentOfTwentyGigabytesLosesNoRow) {
  std::filesystem::resize_file(Segments().back(), kHuge);
  const ReadStreamRows read = Read();
  EXPECT_THAT(read.rows, SizeIs(kRows));
  EXPECT_THAT(read.dropped, IsEmpty()) << "it is known where the stream ended";
  EXPECT_LE(std::filesystem::file_size(Segments().back()), kMaxSegmentBytes);
}

TEST_F(DiskSpoolHoles, EverySegmentOfTwentyGigabytesLosesNoRow) {
  for (const auto& path : Segments()) std::filesystem::resize_file(path, kHuge);
  const ReadStreamRows read = Read();
  EXPECT_THAT(read.rows, SizeIs(kRows));
}

TEST_F(DiskSpoolHoles, AHoleInPlaceOfASegmentLosesItsRows) {
  const auto segments = Segments();
  ASSERT_EQ(segments.size(), 3u);
  std::filesystem::resize_file(segments[1], 0);
  std::filesystem::resize_file(segments[1], kHuge);
  const ReadStreamRows read = Read();
  EXPECT_THAT(read.rows, ::testing::Contains(1));
  EXPECT_THAT(read.rows, ::testing::Contains(kRows));
  EXPECT_EQ(read.rows.size() + read.dropped.size(), kRows);
  EXPECT_GT(read.dropped.size(), 500u);
}

TEST_F(DiskSpoolHoles, AHoleThatNothingNamesIsCounted) {
  const std::string name = FormatSegmentName({.ordinal = 999, .stream_number = 77, .first_seq = 1});
  std::ofstream(directory_.path() / "spool" / name).put('x');
  std::filesystem::resize_file(directory_.path() / "spool" / name, kHuge);
  const auto spool = DiskSpool::Create(Options());
  ASSERT_THAT(spool, IsOk());
  EXPECT_THAT(ReadRows(**spool, kLeft, 1).rows, SizeIs(kRows));
  EXPECT_THAT((*spool)->Status().dropped, SizeIs(1));
}

}  // namespace
}  // namespace rigcal::agent::disk_spool_corruption_test
