// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_board_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/lens/circle_image.h"
#include "common/simulation/events/fast_math.h"

namespace rigcal {
namespace {

constexpr int kRayStep = 4;  // pixels
constexpr double kBlurPx = 0.7;
constexpr int kMarginPx = 4;  // around a disc
constexpr double kScanShare = 0.95;
constexpr double kMostStepUs = 5000, kQuickStepUs = 2000, kPwmSteps = 12;
constexpr double kTremorM = 0.0003;

RigidTransform Between(const RigidTransform& a, const RigidTransform& b, double share) {
  RigidTransform between;
  between.rotation = a.rotation.slerp(share, b.rotation);
  between.translation_m = (1 - share) * a.translation_m + share * b.translation_m;
  return between;
}

float Coverage(double distance_sigma) {  // close to the normal distribution
  const double x = std::clamp(1.702 * distance_sigma, -40.0, 40.0);
  return 1 / (1 + FastExpWithin87(static_cast<float>(-x)));
}

}  // namespace

BoardPath HandHeld(std::vector<RigidTransform> poses, double seconds, double rest) {
  return [poses = std::move(poses), seconds, rest](double time_s) {
    const double at = std::clamp(time_s / seconds, 0.0, static_cast<double>(poses.size()) - 1.001);
    const auto i = static_cast<size_t>(at);
    const double share = std::max(0.0, (at - static_cast<double>(i) - rest) / (1 - rest));
    RigidTransform pose =
        Between(poses[i], poses[i + 1], share * share * (3 - 2 * share));  // a smooth start and end
    const double turn = 2 * std::numbers::pi * time_s;
    pose.translation_m += kTremorM * Eigen::Vector3d(std::sin(2.3 * turn) + std::sin(0.7 * turn),
                                                     std::sin(1.7 * turn + 1), 0);
    return pose;
  };
}

BoardPath Waved(std::vector<RigidTransform> poses, double seconds) {
  return [poses = std::move(poses), seconds](double time_s) {
    const double at = std::clamp(time_s / seconds, 0.0, static_cast<double>(poses.size()) - 1.001);
    const auto i = static_cast<size_t>(at);
    return Between(poses[i], poses[i + 1], at - static_cast<double>(i));
  };
}

EventBoardScene::EventBoardScene(const Board& board, const Intrinsics& lens, const ImageSize& image,
                                 const EventBoardLight& light, const EventRenderOptions& pixels,
                                 BoardPath path)
    : board_(board),
      lens_(lens),
      size_(image),
      light_(light),
      path_(std::move(path)),
      points_(board.Points()),
      noise_(image, pixels),
      pixels_(image, pixels, 0),
      readout_(image.height, 1e-3 * pixels.row_ns, 1e-3 * pixels.event_ns) {
  const size_t count = static_cast<size_t>(size_.width) * size_.height;
  ray_columns_ = static_cast<int>(size_.width) / kRayStep + 3;
  for (int y = -kRayStep; y < static_cast<int>(size_.height) + kRayStep; y += kRayStep) {
    for (int column = 0; column < ray_columns_; ++column) {
      const auto ray = Undistort(lens_, Eigen::Vector2d((column - 1) * kRayStep, y));
      rays_.push_back(
          ray.ok() ? Eigen::Vector3f(static_cast<float>(ray->x()), static_cast<float>(ray->y()), 1)
                   : Eigen::Vector3f(0, 0, -1));
    }
  }
  glare_.resize(count);
  light_now_.resize(count);
  stamp_.assign(count, -1);
  added_.assign(count, -1);
  patches_.resize(points_.size());
  drawn_.resize(points_.size());
  const bool is_print = light_.refresh_hz == 0;
  for (int y = 0; y < static_cast<int>(size_.height); ++y) {
    for (int x = 0; x < static_cast<int>(size_.width); ++x) {
      const double away = (Eigen::Vector2d(x, y) - light_.glare_px).norm() / light_.glare_radius_px;
      const size_t i = static_cast<size_t>(y) * size_.width + static_cast<size_t>(x);
      glare_[i] = static_cast<float>(light_.glare * std::exp(-0.5 * away * away));
      pixels_.Settle(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                     LogLight(x, y, is_print ? 1 : 0, 1));
    }
  }
}

Eigen::Vector3f EventBoardScene::RayAt(float x, float y) const {
  const float u = x / kRayStep + 1, v = y / kRayStep + 1;
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const float a = u - static_cast<float>(column), b = v - static_cast<float>(row);
  const auto at = [&](int c, int r) -> const Eigen::Vector3f& {
    return rays_[static_cast<size_t>(r * ray_columns_ + c)];
  };
  return (1 - b) * ((1 - a) * at(column, row) + a * at(column + 1, row)) +
         b * ((1 - a) * at(column, row + 1) + a * at(column + 1, row + 1));
}

double EventBoardScene::ShownAt(double time_s, double row_share) const {
  const double state_s = light_.blink_refreshes / light_.refresh_hz;
  const double at = time_s - row_share * kScanShare / light_.refresh_hz;
  const double state = std::floor(at / state_s);
  const bool is_shown = static_cast<int64_t>(state) % 2 != 0;
  if (light_.response_ms <= 0) return is_shown ? 1 : 0;
  const double left = std::exp(-(at - state * state_s) / (1e-3 * light_.response_ms));
  return is_shown ? 1 - left : left;
}

double EventBoardScene::BacklightAt(double time_s, double row_share) const {
  double light = 1;
  if (light_.pwm_hz > 0) {
    const double at = time_s * light_.pwm_hz;
    if (at - std::floor(at) >= 0.5) light -= light_.pwm_depth;
  }
  if (light_.oled_dip > 0) {
    const double at = time_s * light_.refresh_hz - kScanShare * row_share;
    if (at - std::floor(at) < light_.oled_dip) light *= 0.3;
  }
  return light;
}

float EventBoardScene::LogLight(int x, int y, float shown, float backlight) const {
  const size_t i = static_cast<size_t>(y) * size_.width + static_cast<size_t>(x);
  return FastLog(glare_[i] + static_cast<float>(light_.ambient) +
                 backlight * (static_cast<float>(light_.black) + shown));
}

void EventBoardScene::DrawDisc(size_t disc, const RigidTransform& board_from_cam,
                               const RigidTransform& pose, double time_s) {
  const Eigen::Vector3f centre = points_[disc].cast<float>();
  const auto radius = static_cast<float>(0.5 * board_.CircleDiameter());
  double lowest = 0, highest = 0;
  for (const Eigen::Vector3d& point : points_) {
    lowest = std::min(lowest, point.y());
    highest = std::max(highest, point.y());
  }
  const double share = 0.1 + 0.8 * (points_[disc].y() - lowest) / (highest - lowest);
  const bool is_print = light_.refresh_hz == 0;
  const auto shown = static_cast<float>(is_print ? 1 : ShownAt(time_s, share));
  const auto backlight = static_cast<float>(is_print ? 1 : BacklightAt(time_s, share));
  const Eigen::Matrix3f turn = board_from_cam.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f eye = board_from_cam.translation_m.cast<float>();
  const auto board_at = [&](float x, float y) {
    const Eigen::Vector3f ray = turn * RayAt(x, y);
    return Eigen::Vector3f(eye - eye.z() / ray.z() * ray);
  };
  // Where its image is.
  Patch now{1 << 20, 1 << 20, -1, -1};
  bool is_seen = true;
  for (int k = 0; k < 16 && is_seen; ++k) {
    const double angle = 2 * std::numbers::pi * k / 16;
    const Eigen::Vector3d rim =
        points_[disc] + 1.02 * radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    Eigen::Vector2d pixel;
    is_seen = Project(lens_, pose * rim, &pixel) && pixel.norm() < 1e4;
    if (!is_seen) break;
    now.left = std::min(now.left, static_cast<int>(pixel.x()) - kMarginPx);
    now.top = std::min(now.top, static_cast<int>(pixel.y()) - kMarginPx);
    now.right = std::max(now.right, static_cast<int>(pixel.x()) + kMarginPx);
    now.bottom = std::max(now.bottom, static_cast<int>(pixel.y()) + kMarginPx);
  }
  if (!is_seen) now = {};
  const Patch& last = patches_[disc];
  Patch& all = drawn_[disc];
  all = now;
  if (last.right >= last.left) {
    if (now.right < now.left) all = last;
    all = {std::min(all.left, last.left), std::min(all.top, last.top),
           std::max(all.right, last.right), std::max(all.bottom, last.bottom)};
  }
  all = {std::max(all.left, 0), std::max(all.top, 0),
         std::min(all.right, static_cast<int>(size_.width) - 1),
         std::min(all.bottom, static_cast<int>(size_.height) - 1)};
  patches_[disc] = now;
  const float x0 = 0.5f * static_cast<float>(now.left + now.right);
  const float y0 = 0.5f * static_cast<float>(now.top + now.bottom);
  Eigen::Matrix<float, 3, 2> scale;  // metres per pixel at the disc
  if (is_seen && x0 > 1 && y0 > 1 && x0 < static_cast<float>(size_.width) - 2 &&
      y0 < static_cast<float>(size_.height) - 2) {
    scale.col(0) = 0.5f * (board_at(x0 + 1, y0) - board_at(x0 - 1, y0));
    scale.col(1) = 0.5f * (board_at(x0, y0 + 1) - board_at(x0, y0 - 1));
  } else {
    is_seen = false;
  }
  for (int y = all.top; y <= all.bottom; ++y) {
    for (int x = all.left; x <= all.right; ++x) {
      const size_t i = static_cast<size_t>(y) * size_.width + static_cast<size_t>(x);
      float covered = 0;
      if (is_seen) {
        const Eigen::Vector3f away =
            board_at(static_cast<float>(x), static_cast<float>(y)) - centre;
        const float distance = std::max(1e-9f, away.norm());
        const float metres_per_px = (scale.transpose() * (away / distance)).norm();
        covered = Coverage((radius - distance) / (metres_per_px * kBlurPx));
      }
      const float white = is_print ? 1 - covered : covered * shown;
      const float light = LogLight(x, y, white, backlight);
      const bool is_first = stamp_[i] != now_us_;
      stamp_[i] = now_us_;
      if (is_first || (is_print ? light < light_now_[i] : light > light_now_[i])) {
        light_now_[i] = light;
      }
    }
  }
}

void EventBoardScene::AddLamp(double time_s) {
  constexpr int kLampPx = 25;
  const auto light =
      FastLog(static_cast<float>(1.2 + std::sin(2 * std::numbers::pi * light_.lamp_hz * time_s)));
  for (int y = -kLampPx; y <= kLampPx; ++y) {
    const int row = static_cast<int>(light_.lamp_px.y()) + y;
    const int half = static_cast<int>(std::sqrt(kLampPx * kLampPx - y * y));
    const int left = static_cast<int>(light_.lamp_px.x()) - half;
    const std::vector<float> to(static_cast<size_t>(2 * half + 1), light);
    pixels_.Add(static_cast<uint32_t>(left), static_cast<uint32_t>(row), {}, to);
  }
}

int64_t EventBoardScene::StepUs(int64_t now_us) const {
  const double time_s = 1e-6 * static_cast<double>(now_us);
  if (light_.refresh_hz == 0) return static_cast<int64_t>(kQuickStepUs);
  double step_us = kMostStepUs;
  const double state_s = light_.blink_refreshes / light_.refresh_hz;
  const double since_s = std::fmod(time_s, state_s);
  const double change_s = 1.05 / light_.refresh_hz + 4e-3 * light_.response_ms;
  if (since_s < change_s) {
    step_us = kQuickStepUs;
  } else {
    step_us = std::min(step_us, 1e6 * (state_s - since_s) + 1);
  }
  if (light_.pwm_hz > 0) step_us = std::min(step_us, 1e6 / light_.pwm_hz / kPwmSteps);
  if (light_.oled_dip > 0) {
    step_us = std::min(step_us, 1e6 * light_.oled_dip / light_.refresh_hz / 2);
  }
  if (light_.lamp_hz > 0) step_us = std::min(step_us, 1e6 / light_.lamp_hz / kPwmSteps);
  return std::max<int64_t>(50, static_cast<int64_t>(step_us));
}

void EventBoardScene::Step(int64_t end_us) {
  const double end_s = 1e-6 * static_cast<double>(end_us);
  const double begin_s = 1e-6 * static_cast<double>(now_us_);
  noise_events_.clear();
  noise_.Until(static_cast<double>(end_us), &noise_events_);
  pixels_.Fire(noise_events_, &requests_);
  bool is_dark = light_.refresh_hz > 0;
  for (const double share : {0.0, 1.0}) {
    is_dark = is_dark && ShownAt(begin_s, share) < 1e-4 && ShownAt(end_s, share) < 1e-4;
  }
  if (!is_dark) {
    const RigidTransform pose = path_(end_s);
    const RigidTransform board_from_cam = pose.Inverse();
    for (size_t disc = 0; disc < points_.size(); ++disc) {
      DrawDisc(disc, board_from_cam, pose, end_s);
    }
    for (const Patch& patch : drawn_) {
      for (int y = patch.top; y <= patch.bottom; ++y) {
        const size_t row = static_cast<size_t>(y) * size_.width;
        for (int x = patch.left; x <= patch.right; ++x) {
          const int begin = x;
          while (x <= patch.right && added_[row + static_cast<size_t>(x)] != now_us_) {
            added_[row + static_cast<size_t>(x)] = now_us_;
            ++x;
          }
          if (x == begin) continue;
          pixels_.Add(static_cast<uint32_t>(begin), static_cast<uint32_t>(y), {},
                      std::span<const float>(light_now_.data() + row + begin,
                                             static_cast<size_t>(x - begin)));
        }
      }
    }
  }
  if (light_.lamp_hz > 0) AddLamp(end_s);
  pixels_.FollowAdded(static_cast<double>(now_us_), static_cast<double>(end_us - now_us_),
                      &requests_);
  now_us_ = end_us;
}

void EventBoardScene::Render(int64_t end_us, std::vector<SimulatedEvent>* events) {
  while (now_us_ < end_us) {
    Step(std::min(end_us, now_us_ + StepUs(now_us_)));
    readout_.Read(&requests_, static_cast<double>(now_us_), events);
  }
}

std::vector<Eigen::Vector2d> EventBoardScene::TruthAt(double time_s) const {
  const RigidTransform pose = path_(time_s);
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& point : points_) {
    Eigen::Vector2d pixel(NAN, NAN), offset_px(0, 0);
    if (Project(lens_, pose * point, &pixel) &&
        CircleOffset(lens_, pose, point, 0.5 * board_.CircleDiameter(), &offset_px)) {
      pixel += offset_px;
    }
    pixels.push_back(pixel);
  }
  return pixels;
}

}  // namespace rigcal
