// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_event_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "agent/event_files/hdf5_event_writer.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::hdf5_event_reader_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Files as other programs write them.
class Hdf5File {
 public:
  explicit Hdf5File(const std::string& path)
      : file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)) {}
  ~Hdf5File() { H5Fclose(file_); }

  void Group(const std::string& name) {
    H5Gclose(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  }
  template <typename Value>
  void Dataset(const std::string& name, hid_t type, const std::vector<Value>& values,
               hid_t creation = H5P_DEFAULT) {
    const hsize_t size = values.size();
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    const hid_t dataset =
        H5Dcreate2(file_, name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    ASSERT_GE(dataset, 0) << name;
    ASSERT_GE(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
    H5Dclose(dataset);
    H5Sclose(space);
  }
  void Scalar(const std::string& name, int64_t value) {
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t dataset = H5Dcreate2(file_, name.c_str(), H5T_NATIVE_INT64, space, H5P_DEFAULT,
                                     H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(dataset, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value);
    H5Dclose(dataset);
    H5Sclose(space);
  }
  void TextAttribute(const char* name, const std::string& value, bool variable) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, variable ? H5T_VARIABLE : value.size());
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(file_, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    const char* const text = value.c_str();
    H5Awrite(attribute, type, variable ? static_cast<const void*>(&text) : text);
    H5Aclose(attribute);
    H5Sclose(space);
    H5Tclose(type);
  }
  void NumbersAttribute(const char* name, const std::vector<int>& values) {
    const hsize_t size = values.size();
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    const hid_t attribute =
        H5Acreate2(file_, name, H5T_NATIVE_INT, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, H5T_NATIVE_INT, values.data());
    H5Aclose(attribute);
    H5Sclose(space);
  }
  hid_t id() const { return file_; }

 private:
  hid_t file_;
};

class Hdf5EventReaderTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::vector<PlainEvent>> ReadAll(const EventFileOptions& options = {}) {
    auto reader = OpenHdf5Events(path_, options);
    if (!reader.ok()) return reader.status();
    facts_ = (*reader)->header();
    std::vector<PlainEvent> all, block;
    while (true) {
      const absl::Status status = (*reader)->Read(3, &block);
      if (!status.ok()) return status;
      if (block.empty()) return all;
      for (size_t i = 0; i < block.size(); ++i) places_.push_back((*reader)->PlaceInBlock(i));
      all.insert(all.end(), block.begin(), block.end());
    }
  }
  // Four events at 10, 20, 30, 40 us.
  void WriteColumns(Hdf5File* file) {
    file->Group("/events");
    file->Dataset<uint16_t>("/events/x", H5T_NATIVE_UINT16, {1, 2, 3, 4});
    file->Dataset<uint16_t>("/events/y", H5T_NATIVE_UINT16, {5, 6, 7, 8});
    file->Dataset<uint8_t>("/events/p", H5T_NATIVE_UINT8, {0, 1, 0, 1});
    file->Dataset<uint32_t>("/events/t", H5T_NATIVE_UINT32, {10, 20, 30, 40});
  }

  testing::TemporaryDirectory directory_;
  std::string path_ = (directory_.path() / "left.h5").string();
  EventFileHeader facts_;
  std::vector<std::string> places_;
};

PlainEvent Cd(int64_t time_us, uint16_t x, uint16_t y, bool on) {
  return {.time_us = time_us, .x = x, .y = y, .kind = on ? PlainEvent::kOn : PlainEvent::kOff};
}

TEST_F(Hdf5EventReaderTest, ColumnsWithATimeOffset) {
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    file.Scalar("/t_offset", 49'599'300'523);
    file.Dataset<uint64_t>("/ms_to_idx", H5T_NATIVE_UINT64, {0, 4});
  }
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll());
  EXPECT_THAT(events, ElementsAre(Cd(49'599'300'533, 1, 5, false), Cd(49'599'300'543, 2, 6, true),
                                  Cd(49'599'300'553, 3, 7, false), Cd(49'599'300'563, 4, 8, true)));
  EXPECT_FALSE(facts_.geometry);
  EXPECT_EQ(facts_.time_unit, TimeUnit::kMicroseconds);
  EXPECT_THAT(places_[3], HasSubstr("row 3 of /events"));
}

// As e2vid and its relatives write them.
TEST_F(Hdf5EventReaderTest, ColumnsOfSecondsAndBools) {
  {
    Hdf5File file(path_);
    file.Group("/events");
    const hid_t boolean = H5Tenum_create(H5T_NATIVE_INT8);
    int8_t value = 0;
    H5Tenum_insert(boolean, "FALSE", &value);
    value = 1;
    H5Tenum_insert(boolean, "TRUE", &value);
    file.Dataset<int16_t>("/events/xs", H5T_NATIVE_INT16, {1, -2, 3});
    file.Dataset<int32_t>("/events/ys", H5T_NATIVE_INT32, {5, 70000, 7});
    file.Dataset<int8_t>("/events/ps", boolean, {1, 0, 1});
    file.Dataset<double>("/events/ts", H5T_NATIVE_DOUBLE, {0.0000014, 1.0, 1000000000.000001});
    file.NumbersAttribute("sensor_resolution", {180, 240});
    H5Tclose(boolean);
  }
  ASSERT_OK_AND_ASSIGN(auto events, ReadAll());
  // What is no pixel of any sensor is for the decoder to count.
  EXPECT_THAT(events, ElementsAre(Cd(1, 1, 5, true), Cd(1'000'000, 65535, 65535, false),
                                  Cd(1'000'000'000'000'001, 3, 7, true)));
  EXPECT_EQ(facts_.geometry, (SensorGeometry{240, 180}));
  EXPECT_EQ(facts_.time_unit, TimeUnit::kSeconds);
  ASSERT_OK_AND_ASSIGN(events, ReadAll({.time_unit = TimeUnit::kMicroseconds}));
  EXPECT_EQ(events[2].time_us, 1'000'000'000);
}

TEST_F(Hdf5EventReaderTest, TimesOfOtherUnits) {
  {
    Hdf5File file(path_);
    WriteColumns(&file);
  }
  ASSERT_OK_AND_ASSIGN(auto events, ReadAll({.time_unit = TimeUnit::kSeconds}));
  EXPECT_EQ(events[1].time_us, 20'000'000);
  ASSERT_OK_AND_ASSIGN(events, ReadAll({.time_unit = TimeUnit::kNanoseconds}));
  EXPECT_EQ(events[1].time_us, 0);
}

TEST_F(Hdf5EventReaderTest, AsksForTheUnitOfTimesThatAreNoMicroseconds) {
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    H5Ldelete(file.id(), "/events/t", H5P_DEFAULT);
    file.Dataset<int64_t>("/events/t", H5T_NATIVE_INT64,
                          {1'700'000'000'000'000'000, 1'700'000'000'000'001'000,
                           1'700'000'000'000'002'000, 1'700'000'000'000'003'000});
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  AllOf(HasSubstr("/events/t"), HasSubstr("time=ns"))));
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll({.time_unit = TimeUnit::kNanoseconds}));
  EXPECT_EQ(events[1].time_us, 1'700'000'000'000'001);
}

TEST_F(Hdf5EventReaderTest, EveryPolarityThatPeopleWrite) {
  struct Case {
    std::vector<int8_t> written;
    std::vector<PlainEvent::Kind> read;
  };
  for (const Case& c : {Case{{1, 0}, {PlainEvent::kOn, PlainEvent::kOff}},
                        Case{{-1, 1}, {PlainEvent::kOff, PlainEvent::kOn}},
                        Case{{2, 5}, {PlainEvent::kUnreadable, PlainEvent::kUnreadable}}}) {
    {
      Hdf5File file(path_);
      file.Group("/events");
      file.Dataset<uint16_t>("/events/x", H5T_NATIVE_UINT16, {1, 2});
      file.Dataset<uint16_t>("/events/y", H5T_NATIVE_UINT16, {1, 2});
      file.Dataset<int8_t>("/events/p", H5T_NATIVE_INT8, c.written);
      file.Dataset<int64_t>("/events/t", H5T_NATIVE_INT64, {1, 2});
    }
    ASSERT_OK_AND_ASSIGN(const auto events, ReadAll());
    ASSERT_EQ(events.size(), 2u);
    EXPECT_EQ(events[0].kind, c.read[0]);
    EXPECT_EQ(events[1].kind, c.read[1]);
  }
}

TEST_F(Hdf5EventReaderTest, TimesThatAreNone) {
  {
    Hdf5File file(path_);
    file.Group("/events");
    file.Dataset<uint16_t>("/events/x", H5T_NATIVE_UINT16, {1, 2, 3});
    file.Dataset<uint16_t>("/events/y", H5T_NATIVE_UINT16, {1, 2, 3});
    file.Dataset<int8_t>("/events/p", H5T_NATIVE_INT8, {1, 1, 1});
    file.Dataset<double>("/events/t", H5T_NATIVE_DOUBLE,
                         {std::nan(""), 1e300, std::numeric_limits<double>::infinity()});
  }
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll());
  for (const PlainEvent& event : events) EXPECT_EQ(event.kind, PlainEvent::kUnreadable);
}

struct CdRow {
  uint16_t x, y;
  int16_t p;
  int64_t t;
};
struct TriggerRow {
  int16_t p;
  int64_t t;
  int16_t id;
};

// As Prophesee's own files are laid out, in native and in wider types.
void WriteCompound(const std::string& path, bool wide) {
  Hdf5File file(path);
  file.TextAttribute("geometry", "1280x720", wide);
  file.TextAttribute("serial_number", "00042", !wide);
  file.Group("/CD");
  file.Group("/EXT_TRIGGER");
  const hid_t cd = H5Tcreate(H5T_COMPOUND, sizeof(CdRow));
  H5Tinsert(cd, "x", offsetof(CdRow, x), H5T_NATIVE_UINT16);
  H5Tinsert(cd, "y", offsetof(CdRow, y), H5T_NATIVE_UINT16);
  H5Tinsert(cd, "p", offsetof(CdRow, p), H5T_NATIVE_INT16);
  H5Tinsert(cd, "t", offsetof(CdRow, t), H5T_NATIVE_INT64);
  const std::vector<CdRow> rows = {{1, 2, 1, 100}, {3, 4, 0, 200}, {5, 6, 1, 300}};
  if (wide) {
    struct WideRow {
      int64_t t;
      int32_t p, x, y;
    };
    const hid_t type = H5Tcreate(H5T_COMPOUND, sizeof(WideRow));
    H5Tinsert(type, "t", offsetof(WideRow, t), H5T_NATIVE_INT64);
    H5Tinsert(type, "p", offsetof(WideRow, p), H5T_NATIVE_INT32);
    H5Tinsert(type, "x", offsetof(WideRow, x), H5T_NATIVE_INT32);
    H5Tinsert(type, "y", offsetof(WideRow, y), H5T_NATIVE_INT32);
    std::vector<WideRow> wide_rows;
    for (const CdRow& row : rows) wide_rows.push_back({row.t, row.p, row.x, row.y});
    file.Dataset("/CD/events", type, wide_rows);
    H5Tclose(type);
  } else {
    file.Dataset("/CD/events", cd, rows);
  }
  const hid_t edge = H5Tcreate(H5T_COMPOUND, sizeof(TriggerRow));
  H5Tinsert(edge, "p", offsetof(TriggerRow, p), H5T_NATIVE_INT16);
  H5Tinsert(edge, "t", offsetof(TriggerRow, t), H5T_NATIVE_INT64);
  H5Tinsert(edge, "id", offsetof(TriggerRow, id), H5T_NATIVE_INT16);
  file.Dataset<TriggerRow>("/EXT_TRIGGER/events", edge, {{1, 150, 6}, {0, 250, 6}, {1, 999, 6}});
  H5Tclose(cd);
  H5Tclose(edge);
}

TEST_F(Hdf5EventReaderTest, CompoundsWithTriggersMergedIn) {
  for (const bool wide : {false, true}) {
    WriteCompound(path_, wide);
    places_.clear();
    ASSERT_OK_AND_ASSIGN(const auto events, ReadAll());
    const auto edge = [](int64_t time_us, bool rising) {
      return PlainEvent{.time_us = time_us,
                        .kind = rising ? PlainEvent::kTriggerRising : PlainEvent::kTriggerFalling,
                        .channel = 6};
    };
    EXPECT_THAT(events, ElementsAre(Cd(100, 1, 2, true), edge(150, true), Cd(200, 3, 4, false),
                                    edge(250, false), Cd(300, 5, 6, true), edge(999, true)));
    EXPECT_THAT(places_, ElementsAre("row 0 of /CD/events", "row 0 of /EXT_TRIGGER/events",
                                     "row 1 of /CD/events", "row 1 of /EXT_TRIGGER/events",
                                     "row 2 of /CD/events", "row 2 of /EXT_TRIGGER/events"));
    EXPECT_EQ(facts_.geometry, (SensorGeometry{1280, 720}));
    EXPECT_EQ(facts_.fields["serial_number"], "00042");
  }
}

TEST_F(Hdf5EventReaderTest, WrittenAndReadAgainInTheSameOrder) {
  // Triggers among events of their own time, clocks that begin anew, two datasets' worth of chunks.
  std::vector<PlainEvent> written;
  int64_t time_us = 1;
  for (int i = 0; i < 200'000; ++i) {
    if (i == 120'000) time_us = 5;
    time_us += i % 3;
    PlainEvent event = Cd(time_us, static_cast<uint16_t>(i % 640), 7, i % 2 == 0);
    if (i % 1000 == 500) {
      event = {.time_us = time_us, .kind = PlainEvent::kTriggerRising, .channel = 3};
    }
    written.push_back(event);
  }
  ASSERT_OK_AND_ASSIGN(auto writer, CreateHdf5EventWriter(
                                        path_, {.geometry = SensorGeometry{640, 480}, .fields = {}},
                                        Hdf5EventLayout::kCompound));
  ASSERT_THAT(writer->Write(written), IsOk());
  ASSERT_THAT(writer->Finish(), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto read, ReadAll());
  EXPECT_TRUE(read == written);
  EXPECT_EQ(facts_.geometry, (SensorGeometry{640, 480}));
}

TEST_F(Hdf5EventReaderTest, ManyAtOnce) {
  WriteCompound(path_, false);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([this] {
      for (int round = 0; round < 20; ++round) {
        auto reader = OpenHdf5Events(path_, {});
        ASSERT_THAT(reader, IsOk());
        std::vector<PlainEvent> block;
        ASSERT_THAT((*reader)->Read(100, &block), IsOk());
        EXPECT_EQ(block.size(), 6u);
        EXPECT_EQ(OpenHdf5Events(path_ + ".none", {}).status().code(), absl::StatusCode::kNotFound);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST_F(Hdf5EventReaderTest, RefusesLengthsThatDiffer) {
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    H5Ldelete(file.id(), "/events/t", H5P_DEFAULT);
    file.Dataset<uint32_t>("/events/t", H5T_NATIVE_UINT32, {10, 20, 30});
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  AllOf(HasSubstr("left.h5"), HasSubstr("/events/x 4"),
                                        HasSubstr("/events/t 3"))));
}

TEST_F(Hdf5EventReaderTest, RefusesMissingAndWrongColumns) {
  {
    Hdf5File file(path_);
    file.Group("/other");
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  AllOf(HasSubstr("/CD/events"), HasSubstr("/other"))));
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    H5Ldelete(file.id(), "/events/p", H5P_DEFAULT);
  }
  EXPECT_THAT(ReadAll(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no dataset /events/p")));
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    H5Ldelete(file.id(), "/events/x", H5P_DEFAULT);
    file.Dataset<float>("/events/x", H5T_NATIVE_FLOAT, {1, 2, 3, 4});
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  AllOf(HasSubstr("/events/x"), HasSubstr("floating"))));
  {
    Hdf5File file(path_);
    const hid_t type = H5Tcreate(H5T_COMPOUND, 8);
    H5Tinsert(type, "x", 0, H5T_NATIVE_UINT16);
    file.Group("/CD");
    file.Dataset<int64_t>("/CD/events", type, {1, 2});
    H5Tclose(type);
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  AllOf(HasSubstr("/CD/events"), HasSubstr("no member y"))));
  {
    Hdf5File file(path_);
    const hsize_t size[2] = {5, 4};
    const hid_t space = H5Screate_simple(2, size, nullptr);
    H5Dclose(H5Dcreate2(file.id(), "/events", H5T_NATIVE_UINT32, space, H5P_DEFAULT, H5P_DEFAULT,
                        H5P_DEFAULT));
    H5Sclose(space);
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("2 dimensions")));
}

// Prophesee's own compression, which needs their plugin: names it and what to do.
TEST_F(Hdf5EventReaderTest, NamesAFilterThatIsNotInstalled) {
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    H5Ldelete(file.id(), "/events/t", H5P_DEFAULT);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = 4;
    H5Pset_chunk(creation, 1, &chunk);
    // Optional, so that a file can be made with a filter that is not here.
    H5Pset_filter(creation, 0x8ECF, H5Z_FLAG_OPTIONAL, 0, nullptr);
    file.Dataset<uint32_t>("/events/t", H5T_NATIVE_UINT32, {10, 20, 30, 40}, creation);
    H5Pclose(creation);
  }
  EXPECT_THAT(ReadAll(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("/events/t"), HasSubstr("ECF"), HasSubstr("36559"),
                             HasSubstr("HDF5_PLUGIN_PATH"), HasSubstr("h5repack"))));
}

TEST_F(Hdf5EventReaderTest, RefusesChunksThatMemoryCannotHold) {
  {
    Hdf5File file(path_);
    WriteColumns(&file);
    H5Ldelete(file.id(), "/events/t", H5P_DEFAULT);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = hsize_t{1} << 26, size = 4, unlimited = H5S_UNLIMITED;
    H5Pset_chunk(creation, 1, &chunk);
    const hid_t space = H5Screate_simple(1, &size, &unlimited);
    H5Dclose(H5Dcreate2(file.id(), "/events/t", H5T_NATIVE_INT64, space, H5P_DEFAULT, creation,
                        H5P_DEFAULT));
    H5Sclose(space);
    H5Pclose(creation);
  }
  EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  AllOf(HasSubstr("512 MB"), HasSubstr("h5repack -l"))));
}

// Cut anywhere, the file is refused or what is there is read; nothing else.
TEST_F(Hdf5EventReaderTest, TruncatedAnywhere) {
  std::vector<PlainEvent> events;
  for (int i = 0; i < 300'000; ++i)
    events.push_back(Cd(i, static_cast<uint16_t>(i % 600), 1, true));
  ASSERT_OK_AND_ASSIGN(auto writer, CreateHdf5EventWriter(path_, {}, Hdf5EventLayout::kCompound));
  ASSERT_THAT(writer->Write(events), IsOk());
  ASSERT_THAT(writer->Finish(), IsOk());
  const auto size = std::filesystem::file_size(path_);
  for (const double share : {0.99, 0.9, 0.5, 0.1, 0.01, 0.001}) {
    std::filesystem::resize_file(path_, static_cast<uintmax_t>(static_cast<double>(size) * share));
    EXPECT_THAT(ReadAll(), StatusIs(absl::StatusCode::kInvalidArgument,
                                    AllOf(HasSubstr("left.h5"), HasSubstr("HDF5"))))
        << share;
  }
}

// A damaged chunk in the middle: what was read before it stays, the message names the rows.
TEST_F(Hdf5EventReaderTest, ADamagedChunk) {
  std::vector<PlainEvent> events;
  for (int i = 0; i < 300'000; ++i) {
    events.push_back(Cd(i, static_cast<uint16_t>(i % 997 * 7919 % 600), 1, true));
  }
  ASSERT_OK_AND_ASSIGN(auto writer, CreateHdf5EventWriter(path_, {}, Hdf5EventLayout::kCompound));
  ASSERT_THAT(writer->Write(events), IsOk());
  ASSERT_THAT(writer->Finish(), IsOk());
  const auto size = std::filesystem::file_size(path_);
  {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(size / 2));
    file << std::string(2000, '\xff');
  }
  EXPECT_THAT(ReadAll(),
              StatusIs(absl::StatusCode::kDataLoss,
                       AllOf(HasSubstr("left.h5"), HasSubstr("rows"), HasSubstr("/CD/events"))));
  EXPECT_GE(places_.size(), 65536u);
}

TEST_F(Hdf5EventReaderTest, AnEmptyRecording) {
  ASSERT_OK_AND_ASSIGN(auto writer, CreateHdf5EventWriter(path_, {}, Hdf5EventLayout::kColumns));
  ASSERT_THAT(writer->Finish(), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll());
  EXPECT_TRUE(events.empty());
}

}  // namespace
}  // namespace rigcal::agent::hdf5_event_reader_test
