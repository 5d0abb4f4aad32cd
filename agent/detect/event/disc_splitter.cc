// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/disc_splitter.h"

#include <algorithm>
#include <climits>

namespace rigcal::agent {
namespace {

// Of more, the pixels are no markers of a wand, and giving each to the nearest would take long.
constexpr int kMaxParts = 64;

}  // namespace

void DiscSplitter::MeasureDepth(const PixelList& pixels) {
  int x1 = INT_MIN, y1 = INT_MIN;
  x0_ = y0_ = INT_MAX;
  for (const auto& [x, y] : pixels) {
    x0_ = std::min(x0_, x), x1 = std::max(x1, x);
    y0_ = std::min(y0_, y), y1 = std::max(y1, y);
  }
  // A frame of pixels outside saves every look at a border.
  --x0_, --y0_;
  width_ = x1 - x0_ + 2, height_ = y1 - y0_ + 2;
  const size_t size = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  depth_.assign(size, 0);
  for (const auto& [x, y] : pixels) {
    depth_[static_cast<size_t>((y - y0_) * width_ + x - x0_)] = INT_MAX / 2;
  }
  const auto lower = [this](int at, int by, int cost) {
    int& depth = depth_[static_cast<size_t>(at)];
    depth = std::min(depth, depth_[static_cast<size_t>(at + by)] + cost);
  };
  const int first = width_ + 1, last = width_ * (height_ - 1) - 2;
  for (int at = first; at <= last; ++at) {
    lower(at, -1, 3), lower(at, -width_, 3), lower(at, -width_ - 1, 4), lower(at, -width_ + 1, 4);
  }
  deepest_ = 0;
  for (int at = last; at >= first; --at) {
    lower(at, 1, 3), lower(at, width_, 3), lower(at, width_ + 1, 4), lower(at, width_ - 1, 4);
    deepest_ = std::max(deepest_, depth_[static_cast<size_t>(at)]);
  }
}

int DiscSplitter::Root(int at) {
  while (parent_[static_cast<size_t>(at)] != at) {
    int& parent = parent_[static_cast<size_t>(at)];
    parent = parent_[static_cast<size_t>(parent)];
    at = parent;
  }
  return at;
}

// From the deepest level outwards, each pixel once: parts that meet are joined, and only those that
// are somewhere thick enough count.
DiscSplitter::Level DiscSplitter::FindLevel(const PixelList& pixels, int min_depth) {
  by_depth_.assign(static_cast<size_t>(deepest_) + 1, {});
  for (const auto& [x, y] : pixels) {
    const int at = (y - y0_) * width_ + x - x0_;
    by_depth_[static_cast<size_t>(depth_[static_cast<size_t>(at)])].push_back(at);
  }
  parent_.assign(depth_.size(), -1);
  thick_.assign(depth_.size(), 0);
  const int around[] = {-1, 1, -width_, width_, -width_ - 1, -width_ + 1, width_ - 1, width_ + 1};
  Level best{.level = 0, .parts = 1};
  int parts = 0;
  for (int level = deepest_ - 1; level >= 1; --level) {
    for (const int at : by_depth_[static_cast<size_t>(level) + 1]) {
      int root = parent_[static_cast<size_t>(at)] = at;
      thick_[static_cast<size_t>(at)] = level + 1 >= min_depth;
      parts += thick_[static_cast<size_t>(at)];
      for (const int by : around) {
        if (parent_[static_cast<size_t>(at + by)] < 0) continue;
        const int other = Root(at + by);
        if (other == root) continue;
        parent_[static_cast<size_t>(root)] = other;
        parts -= thick_[static_cast<size_t>(root)] & thick_[static_cast<size_t>(other)];
        thick_[static_cast<size_t>(other)] |= thick_[static_cast<size_t>(root)];
        root = other;
      }
    }
    if (parts > 1 && parts >= best.parts) best = {.level = level, .parts = parts};
  }
  return best;
}

int DiscSplitter::MarkParts(const PixelList& pixels, int level, int min_depth) {
  part_.assign(depth_.size(), 0);
  int count = 0;
  const int around[] = {-1, 1, -width_, width_, -width_ - 1, -width_ + 1, width_ - 1, width_ + 1};
  for (const auto& [x, y] : pixels) {
    const int start = (y - y0_) * width_ + x - x0_;
    // A part begins only where it is thick enough, and its thinner pixels join it from there.
    if (depth_[static_cast<size_t>(start)] < min_depth || part_[static_cast<size_t>(start)] != 0) {
      continue;
    }
    part_[static_cast<size_t>(start)] = ++count;
    pending_.assign(1, start);
    while (!pending_.empty()) {
      const int at = pending_.back();
      pending_.pop_back();
      for (const int by : around) {
        const auto next = static_cast<size_t>(at + by);
        if (depth_[next] <= level || part_[next] != 0) continue;
        part_[next] = count;
        pending_.push_back(at + by);
      }
    }
  }
  return count;
}

void DiscSplitter::FitDiscs(const PixelList& pixels, int count) {
  discs_.assign(static_cast<size_t>(count), {});
  for (const auto& [x, y] : pixels) {
    const auto at = static_cast<size_t>((y - y0_) * width_ + x - x0_);
    if (part_[at] == 0) continue;
    Disc& disc = discs_[static_cast<size_t>(part_[at] - 1)];
    disc.x += x, disc.y += y, disc.count += 1;
    disc.radius = std::max(disc.radius, depth_[at] / 3.0);
  }
  for (Disc& disc : discs_) disc.x /= disc.count, disc.y /= disc.count;
}

size_t DiscSplitter::Nearest(int x, int y) const {
  size_t nearest = 0;
  double least = 0;
  for (size_t i = 0; i < discs_.size(); ++i) {
    const double dx = x - discs_[i].x, dy = y - discs_[i].y;
    const double power = dx * dx + dy * dy - discs_[i].radius * discs_[i].radius;
    if (i == 0 || power < least) nearest = i, least = power;
  }
  return nearest;
}

const std::vector<PixelList>& DiscSplitter::Split(const PixelList& pixels, int min_pixels) {
  parts_.clear();
  if (pixels.empty()) return parts_;
  MeasureDepth(pixels);
  const int min_depth = std::max(4, deepest_ / 2);
  const Level best = FindLevel(pixels, min_depth);
  if (best.parts == 1 || best.parts > kMaxParts) {
    parts_.push_back(pixels);
    return parts_;
  }
  const int count = MarkParts(pixels, best.level, std::max(min_depth, best.level + 1));
  FitDiscs(pixels, count);
  parts_.resize(static_cast<size_t>(count));
  for (const auto& [x, y] : pixels) parts_[Nearest(x, y)].emplace_back(x, y);
  std::erase_if(parts_, [min_pixels](const PixelList& part) {
    return static_cast<int>(part.size()) < min_pixels;
  });
  return parts_;
}

}  // namespace rigcal::agent
