// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/blinking_wand.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <random>
#include <string>
#include <tuple>

namespace rigcal::testing {
namespace {

constexpr std::array kPlacesM = {0.0, 0.13, 0.39};
constexpr double kDiameterM = 0.04;
constexpr double kStepS = 5e-5;

}  // namespace

Intrinsics BlinkingWand::CameraIntrinsics() const {
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = 600;
  intrinsics.cx_px = 0.5 * (geometry.width - 1);
  intrinsics.cy_px = 0.5 * (geometry.height - 1);
  return intrinsics;
}

double BlinkingWand::RadiusPx() const { return 600 * kDiameterM / 2 / distance_m; }

Eigen::Vector2d BlinkingWand::CentreAt(int marker, double time_s) const {
  // The wand is tilted in the image, so that its markers differ in both coordinates.
  const Eigen::Vector2d along(std::cos(0.3), std::sin(0.3));
  const Eigen::Vector2d place_m = Eigen::Vector2d(-0.3, -0.05) +
                                  kPlacesM[static_cast<size_t>(marker)] * along +
                                  Eigen::Vector2d((time_s - first_s) * velocity_m_s, 0);
  const Intrinsics intrinsics = CameraIntrinsics();
  return Eigen::Vector2d(intrinsics.cx_px, intrinsics.cy_px) +
         intrinsics.fx_px / distance_m * place_m;
}

std::vector<uint8_t> BlinkingWand::RawFile() const {
  std::mt19937 random(7);
  std::vector<agent::CdEvent> events;
  std::vector<bool> bright(size_t{geometry.width} * geometry.height, false);
  const auto add = [&](double time_s, int x, int y, bool on) {
    events.push_back({std::llround((first_s + time_s) * 1e6), static_cast<uint16_t>(x),
                      static_cast<uint16_t>(y), on});
  };
  for (double t = 0; visible && t < duration_s; t += kStepS) {
    const double phase = t * blink_hz;
    const bool lit = phase - std::floor(phase) < 0.5;
    for (int marker = 0; marker < 3; ++marker) {
      const Eigen::Vector2d centre = CentreAt(marker, first_s + t);
      const int reach = static_cast<int>(RadiusPx()) + 2;
      const Eigen::Vector2i middle = centre.cast<int>();
      for (int y = middle.y() - reach; y <= middle.y() + reach; ++y) {
        for (int x = middle.x() - reach; x <= middle.x() + reach; ++x) {
          if (x < 0 || y < 0 || x >= static_cast<int>(geometry.width) ||
              y >= static_cast<int>(geometry.height)) {
            continue;
          }
          const size_t pixel = static_cast<size_t>(y) * geometry.width + static_cast<size_t>(x);
          const bool now = lit && (Eigen::Vector2d(x, y) - centre).norm() < RadiusPx();
          const bool answers = now != bright[pixel] && !(falls_only && now);
          if (answers) add(t + static_cast<double>(random() % 50) * 1e-6, x, y, now);
          bright[pixel] = now;
        }
      }
    }
  }
  std::uniform_real_distribution<double> any(0, duration_s);
  for (int i = 0; i < static_cast<int>(noise_per_s * duration_s); ++i) {
    add(any(random), static_cast<int>(random() % geometry.width),
        static_cast<int>(random() % geometry.height), (random() & 1) != 0);
  }
  const auto key = [](const agent::CdEvent& event) {
    return std::tuple(event.time_us, event.y, event.on, event.x);
  };
  std::sort(events.begin(), events.end(),
            [&](const auto& a, const auto& b) { return key(a) < key(b); });

  const std::string header = agent::Evt3Header(geometry, "1");
  std::vector<uint8_t> bytes(header.begin(), header.end());
  agent::Evt3Writer writer;
  auto begin = events.begin();
  for (const agent::TriggerEvent& trigger : triggers) {
    const auto end = std::find_if(begin, events.end(), [&](const agent::CdEvent& event) {
      return event.time_us > trigger.time_us;
    });
    writer.Write({begin, end}, &bytes);
    writer.Write(trigger, &bytes);
    begin = end;
  }
  writer.Write({begin, events.end()}, &bytes);
  return bytes;
}

void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

}  // namespace rigcal::testing
