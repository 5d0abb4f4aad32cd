// SPDX-License-Identifier: Apache-2.0
// Writes the seeds of the corpus, those that are made by hand: fuzz.make_corpus tests/fuzz/corpus.
// What fuzzing has found lies beside them in files named found_*.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "common/wire/calibration_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/session_wire.h"
#include "server/store/batch_blob.h"
#include "tests/fuzz/spool_corpus.h"

namespace rigcal::agent {
namespace {

using Bytes = std::vector<uint8_t>;

bool Save(const std::filesystem::path& folder, const std::string& name, const Bytes& bytes) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  std::ofstream file(folder / name, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) std::fprintf(stderr, "cannot write %s\n", (folder / name).c_str());
  return static_cast<bool>(file);
}

template <typename Word>
void Append(Word word, Bytes* bytes) {
  for (size_t i = 0; i < sizeof(Word); ++i) bytes->push_back(static_cast<uint8_t>(word >> 8 * i));
}

void Put(std::initializer_list<uint8_t> more, Bytes* bytes) {
  for (const uint8_t byte : more) bytes->push_back(byte);
}

// What stands in front of a stream in the decoders' targets (decoder_fuzz.h).
Bytes Case(SensorGeometry geometry, const std::vector<uint16_t>& cuts) {
  Bytes bytes;
  Append(static_cast<uint16_t>(geometry.width - 1), &bytes);
  Append(static_cast<uint16_t>(geometry.height - 1), &bytes);
  bytes.push_back(static_cast<uint8_t>(cuts.size()));
  for (const uint16_t cut : cuts) Append(cut, &bytes);
  return bytes;
}

template <typename Word>
Bytes Words(SensorGeometry geometry, const std::vector<uint16_t>& cuts,
            const std::vector<Word>& words) {
  Bytes bytes = Case(geometry, cuts);
  for (const Word word : words) Append(word, &bytes);
  return bytes;
}

Bytes Text(const std::string& text) { return {text.begin(), text.end()}; }

bool SaveHeaders(const std::filesystem::path& folder) {
  bool ok = true;
  const std::vector<std::pair<std::string, std::string>> texts = {
      {"evt3", "% format EVT3;height=720;width=1280\n% end\n%%%%"},
      {"evt21_legacy", "% format EVT21;endianness=legacy;height=720;width=1280\n% end\n"},
      {"old", "% Date 2020-01-01 00:00:00\n% evt 2.0\n% plugin_name hal_plugin_gen31\n\x01\x02\n"},
      {"events_like_a_line", "% evt 2.0\n%\x01\x02\x80\n\n"},
      {"geometry", "% evt 3.0\r\n% geometry 640x480\r\n% end\r\n"},
      {"geometry_half", "% evt 3.0\n% geometry 640x\n"},
      {"geometry_huge", "% evt 3.0\n% geometry 640x4294967297\n"},
      {"contradiction", "% format EVT3;height=720;width=1280\n% geometry 640x480\n"},
      {"unknown", "% evt 4.0\n"},
      {"no_format", "% date 2023\n% \n%\n% end\n"},
      {"no_line_end", "% evt 3.0\n% geometry 640x480"},
      {"no_raw", "x,y,p,t\n1,2,0,5\n"},
  };
  for (const auto& [name, text] : texts) ok &= Save(folder, name, Text(text));
  return ok;
}

bool SaveEvt3(const std::filesystem::path& folder) {
  Bytes written = Case({1280, 720}, {3, 9, 20});
  Evt3Writer writer;
  std::vector<CdEvent> events;
  for (uint16_t i = 0; i < 40; ++i) {
    const auto x = static_cast<uint16_t>(i < 20 ? 600 + i : 7 * i);
    const auto y = static_cast<uint16_t>(i < 20 ? 300 : i);
    events.push_back({.time_us = 1000 + 150 * (i / 10), .x = x, .y = y, .on = i % 20 < 10});
  }
  writer.Write(events, &written);
  writer.Write(TriggerEvent{.time_us = 5000, .channel = 3, .rising = true}, &written);
  writer.WriteTime(40'000, &written);
  using W = std::vector<uint16_t>;
  const SensorGeometry vga{640, 480};
  bool ok = Save(folder, "written", written);
  ok &= Save(folder, "overflow",
             Words<uint16_t>(vga, {5}, W{0x0007, 0x8fff, 0x2005, 0x8000, 0x6001, 0x2806, 0x8001}));
  ok &= Save(folder, "damaged_time",
             Words<uint16_t>(vga, {1, 3},
                             W{0x0000, 0x8064, 0x2801, 0x8864, 0x2802, 0x8065, 0x2803, 0xa601}));
  ok &= Save(
      folder, "restart",
      Words<uint16_t>(vga, {2},
                      W{0x0000, 0x84b0, 0x6fff, 0x2801, 0x8000, 0x8001, 0x2801, 0x6001, 0xa100}));
  ok &= Save(folder, "gap",
             Words<uint16_t>(vga, {}, W{0x0000, 0x8001, 0x2801, 0x81f4, 0x81f5, 0x2801}));
  ok &= Save(folder, "right_border",
             Words<uint16_t>(vga, {4},
                             W{0x8001, 0x0003, 0x3a7b, 0x4fff, 0x4fff, 0x50ff, 0x37f8, 0x4fff,
                               0x5081, 0x01e0, 0x2801}));
  Bytes half = Words<uint16_t>(vga, {}, W{0x2801, 0xa000, 0x4fff, 0x8001, 0x1000, 0x9fff, 0x7001});
  half.push_back(0x80);
  ok &= Save(folder, "before_time_and_half_a_word", half);
  ok &= Save(folder, "one_pixel",
             Words<uint16_t>({1, 1}, {},
                             W{0x8000, 0x0000, 0x2000, 0x3000, 0x4fff, 0x3800, 0x5001, 0x2801}));
  return ok;
}

bool SaveEvt2(const std::filesystem::path& folder) {
  using W = std::vector<uint32_t>;
  const SensorGeometry vga{640, 480};
  bool ok = Save(folder, "events",
                 Words<uint32_t>(
                     vga, {2},
                     W{0x80000002, 0x10000000 | 9 << 22 | 12 << 11 | 34, 10 << 22 | 639 << 11 | 479,
                       0xa2c00301, 0x10000000 | 640 << 11, 0x50000000, 0x80000003}));
  ok &= Save(
      folder, "overflow",
      Words<uint32_t>(vga, {1, 2}, W{0x8fffffff, 0x10000000, 0x80000000, 0x00400801, 0x80000001}));
  ok &= Save(folder, "restart",
             Words<uint32_t>(vga, {},
                             W{0x80030000, 0x10000000, 0x80000000, 0x80000001, 0x10000801,
                               0x87000000, 0x80000002}));
  Bytes before = Words<uint32_t>(vga, {}, W{0x10000000, 0xa0000000, 0xe0000000, 0x80000001});
  before.push_back(0x10);
  ok &= Save(folder, "before_time_and_part_of_a_word", before);
  return ok;
}

bool SaveEvt21(const std::filesystem::path& folder) {
  using W = std::vector<uint64_t>;
  const SensorGeometry hd{1280, 720};
  const W words = {0x8000000200000000,
                   0x1000000000000000 | uint64_t{9} << 54 | uint64_t{1264} << 43 |
                       uint64_t{34} << 32 | 0x80008001,
                   0x00000000ffffffff,
                   0xa2c0030100000000,
                   0x10000fff00000001,
                   0x8000000300000000};
  W swapped;
  for (const uint64_t word : words) swapped.push_back(word << 32 | word >> 32);
  bool ok = Save(folder, "little", Words<uint64_t>(hd, {1, 3}, words));
  ok &= Save(folder, "legacy", Words<uint64_t>(hd, {1, 3}, swapped));
  ok &= Save(folder, "before_time",
             Words<uint64_t>(hd, {},
                             W{0x10000000ffff0000, 0xa000000000000000, 0x8000000100000000,
                               0x8000700000000000, 0x8000000200000000}));
  return ok;
}

// Enough words without a fault that every kernel runs on them, with some faults between.
bool SaveLongEvt3(const std::filesystem::path& folder) {
  Bytes bytes = Case({1280, 720}, {40, 41, 333, 501});
  Evt3Writer writer;
  std::vector<CdEvent> events;
  uint32_t state = 1;
  for (uint16_t i = 0; i < 240; ++i) {
    state = state * 1664525 + 1013904223;
    const auto x = static_cast<uint16_t>(i % 60 < 30 ? 1220u + 2u * (i % 30u) : state >> 22);
    const auto y = static_cast<uint16_t>(i % 60 < 30 ? 8u + i / 60u : 719u - (state >> 12 & 0x1ff));
    events.push_back({.time_us = 8000 + 200 * (i / 30), .x = x, .y = y, .on = i / 30 % 2 == 0});
  }
  writer.Write(events, &bytes);
  for (const uint32_t word : {0x1000, 0x4fff, 0x4fff, 0x5fff, 0x8002, 0x8002, 0x07ff, 0x2801}) {
    Append(static_cast<uint16_t>(word), &bytes);
  }
  for (CdEvent& event : events) event.time_us += 6000;
  events.resize(120);
  writer.Write(events, &bytes);
  return Save(folder, "long", bytes);
}

bool SavePlain(const std::filesystem::path& folder) {
  Bytes bytes = Case({640, 480}, {2, 5});
  const auto add = [&bytes](int64_t time_us, uint16_t x, uint16_t y, uint16_t kind) {
    Append(static_cast<uint64_t>(time_us), &bytes);
    Append(x, &bytes);
    Append(y, &bytes);
    Append(kind, &bytes);
    Append(uint16_t{0}, &bytes);
  };
  add(1000, 3, 4, 1), add(1500, 5, 4, 0), add(1400, 5, 4, 1), add(2000, 0, 0, 0x0303);
  add(0, 1, 1, 0), add(10, 639, 479, 1), add(int64_t{1} << 40, 2, 2, 0), add(20, 640, 0, 1);
  add(INT64_MIN, 0, 0, 0), add(INT64_MAX, 0, 0, 1), add(-9'000'000'000'000'000, 1, 1, 1);
  add(9'000'000'000'000'000, 1, 1, 0), add(5, 0xffff, 0xffff, 4), add(25, 7, 7, 2);
  bytes.push_back(7);
  return Save(folder, "records", bytes);
}

// Settings and steps of blink_wand_detector.cc.
struct DetectorCase {
  uint8_t kind = 1;  // a scene
  uint8_t times = 0;
  uint8_t filter = 134;  // two periods, 8 pixels, with intrinsics
  uint8_t piece = 5;

  Bytes Begin() const { return {kind, times, filter, 199, 199, piece}; }
};

// Three markers of a wand 0.6 m away, or a screen full of light.
void AppendDiscs(uint8_t y, uint8_t radius, Bytes* bytes) {
  for (const uint8_t x : std::initializer_list<uint8_t>{50, 82, 147}) {
    Put({0, x, y, static_cast<uint8_t>(radius - 1)}, bytes);
  }
}

// Each moves by a pixel or stands still.
void AppendPeriods(int count, uint8_t motion, Bytes* bytes) {
  for (; count > 0; --count) Put({1, motion}, bytes);
}

bool SaveDetector(const std::filesystem::path& folder) {
  bool ok = true;
  for (const auto& [name, blink] :
       {std::pair{"wand_500_hz", 0}, {"wand_20_hz", 1}, {"wand_5000_hz", 2}}) {
    Bytes bytes = DetectorCase{.times = static_cast<uint8_t>(blink)}.Begin();
    AppendDiscs(100, 5, &bytes);
    AppendPeriods(12, 9, &bytes);
    AppendPeriods(blink == 1 ? 6 : 60, 8, &bytes);
    ok &= Save(folder, name, bytes);
  }
  // Triggers in the middle of a pulse, then the wand disappears and reappears elsewhere.
  Bytes bytes = DetectorCase{.times = 0x30}.Begin();
  AppendDiscs(60, 6, &bytes);
  for (int i = 0; i < 20; ++i) {
    AppendPeriods(3, 9, &bytes);
    Put({0x0a, 40, 0, 0x02, 100, 0}, &bytes);
    if (i == 12) {
      bytes.push_back(0x07);
      AppendDiscs(140, 6, &bytes);
    }
  }
  ok &= Save(folder, "wand_triggers", bytes);
  bytes = DetectorCase{.filter = 134 | 32}.Begin();
  AppendDiscs(95, 20, &bytes);
  AppendDiscs(105, 20, &bytes);
  AppendPeriods(40, 8, &bytes);
  ok &= Save(folder, "wide_light", bytes);
  for (const auto& [name, kind] :
       {std::pair{"noise_evt2", 0}, {"noise_evt21", 2}, {"noise_evt3", 4}, {"noise_plain", 6}}) {
    bytes = DetectorCase{.kind = static_cast<uint8_t>(kind | 16), .times = 0x34}.Begin();
    uint32_t state = 12345;
    for (int i = 0; i < 600; ++i) {
      state = state * 1664525 + 1013904223;
      bytes.push_back(static_cast<uint8_t>(state >> 24));
    }
    ok &= Save(folder, name, bytes);
  }
  // A time fault in every second word, followed by an event.
  bytes = DetectorCase{.kind = 4}.Begin();
  for (uint16_t i = 0; i < 200; ++i) {
    Append(static_cast<uint16_t>(0x8000 | (i * 1789 & 0xfff)), &bytes);
    Append(static_cast<uint16_t>(i % 8 == 0 ? i : 0x2800 | i), &bytes);
  }
  return Save(folder, "time_storm", bytes) && ok;
}

bool SaveCsv(const std::filesystem::path& folder) {
  bool ok = true;
  const std::vector<std::pair<std::string, std::string>> texts = {
      {"header",
       std::string(1, '\0') + "# geometry: 640,480\nt,x,y,p\n0.001,1,2,1\n0.0015,3,4,0\n"},
      {"order",
       "\x05"
       "100 1 2 1\r\n101 639 479 -1\r\n\r\n99 5 5 true\r\n"},
      {"bad_lines",
       std::string(1, '\0') + "1,2,1,100\n1,2\nnan,2,1,1e300\n70000,-1,1,5\n1,2,7,6\n"},
      {"two_numbers",
       "\x01"
       "640 480\n1 2 1 0.5\n3;4;0;1.25\n"},
      {"times",
       "\x02"
       "x,y,p,t_ns\n1,2,1,9223372036854775807\n1,2,1,-1\n1,2,0,1e18\n"},
  };
  for (const auto& [name, text] : texts) ok &= Save(folder, name, Text(text));
  return ok;
}

ObservationBatch FourRows() {
  ObservationBatch batch;
  batch.stream = {"session", "left", 1};
  batch.marker_count = 3;
  for (int i = 0; i < 4; ++i) {
    Observation row;
    row.time_ns = 1'000'000 * (i + 1);
    row.markers.resize(3);
    for (MarkerObservation& marker : row.markers) {
      marker.visible = i != 1;
      marker.centre_px = {100.0 * i, 50};
      marker.time_delta_ns = 1000 * i;
    }
    batch.Append(row);
  }
  return batch;
}

// As the store keeps them; the first byte as in stored_blobs.cc.
bool SaveStoredBlobs(const std::filesystem::path& folder) {
  const ObservationBatch batch = FourRows();
  std::string blob;
  server::EncodeBatch(batch, {}, 0, batch.rows(), &blob);
  bool ok = Save(folder, "batch", Text(std::string(1, '\0') + blob));
  const std::string body = blob.substr(0, blob.size() - 4);
  ok &= Save(folder, "batch_without_checksum", Text("\x01" + body));
  ok &= Save(folder, "batch_cut", Text("\x01" + body.substr(0, body.size() / 2)));
  const server::RefusedRow refused[] = {{.row = 1}, {.row = 3}};
  server::EncodeBatch(batch, refused, 0, batch.rows(), &blob);
  ok &= Save(folder, "batch_refused", Text("\x01" + blob.substr(0, blob.size() - 4)));
  Session session;
  session.id = "s-000001";
  session.rig = "rig";
  session.state = SessionState::kFinished;
  session.target.marker_positions_m = {0, 0.13, 0.39};
  session.missing_cameras = {"left"};
  ok &= Save(folder, "session", Text("\x02" + wire::SerializeSession(session)));
  Calibration calibration;
  calibration.id = "c-000001";
  calibration.rig = "rig";
  calibration.session_ids = {"s-000001"};
  calibration.state = CalibrationState::kSucceeded;
  calibration.result.emplace();
  calibration.result->target.given.marker_positions_m = {0, 0.13, 0.39};
  return Save(folder, "calibration", Text("\x04" + wire::SerializeCalibration(calibration))) && ok;
}

bool SaveBatches(const std::filesystem::path& folder) {
  ObservationBatch batch = FourRows();
  const auto save = [&](const std::string& name) {
    v1::ObservationBatch proto;
    wire::ToProto(batch, &proto);
    return Save(folder, name, Text(proto.SerializeAsString()));
  };
  bool ok = save("good");
  batch.time_ns[2] = 5;
  batch.x_px[0] = NAN;
  batch.cov_xx_px2[9] = -1;
  batch.time_delta_ns[10] = INT32_MIN;
  ok &= save("bad_values");
  batch.y_px.pop_back();
  return save("wrong_size") && ok;
}

}  // namespace
}  // namespace rigcal::agent

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "name the folder of the corpus: fuzz.make_corpus tests/fuzz/corpus\n");
    return 2;
  }
  const std::filesystem::path corpus = argv[1];
  bool ok = rigcal::agent::SaveHeaders(corpus / "raw_header");
  ok &= rigcal::agent::SaveEvt3(corpus / "evt3_words");
  ok &= rigcal::agent::SaveEvt2(corpus / "evt2_words");
  ok &= rigcal::agent::SaveEvt21(corpus / "evt21_words");
  ok &= rigcal::agent::SaveLongEvt3(corpus / "evt3_words");
  ok &= rigcal::agent::SavePlain(corpus / "plain_records");
  ok &= rigcal::agent::SaveCsv(corpus / "csv_events");
  ok &= rigcal::agent::SaveBatches(corpus / "observation_batch");
  ok &= rigcal::agent::SaveStoredBlobs(corpus / "stored_blobs");
  ok &= rigcal::agent::SaveSpool(corpus);
  ok &= rigcal::agent::SaveDetector(corpus / "blink_wand_detector");
  return ok ? 0 : 1;
}
