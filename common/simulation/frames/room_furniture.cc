// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/room_furniture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

constexpr uint64_t kFurniturePurpose = 0x66726e74;
constexpr double kFocalWidths = 0.8;

Bgr Times(Bgr colour, double factor) {
  for (double& channel : colour) channel *= factor;
  return colour;
}

// A piece of furniture: its middle in the image, how large a metre is there, and how much light
// falls on it against the room's mean.
class Piece {
 public:
  Piece(RoomPainter* painter, RandomStream* random) : painter_(painter), random_(random) {
    const ImageSize& size = painter->image_size();
    px_per_m_ = kFocalWidths * size.width / random->Uniform(2.5, 6);
    middle_px_ = {random->Uniform() * size.width, random->Uniform() * size.height};
    light_ = random->LogUniform(0.5, 2.5);
  }

  RandomStream& random() { return *random_; }
  double px_per_m() const { return px_per_m_; }
  void MoveTo(const Eigen::Vector2d& middle_px) { middle_px_ = middle_px; }

  // An upright rectangle or ellipse; `at_m` from the middle, right and down.
  RoomShape Shape(const Eigen::Vector2d& at_m, const Eigen::Vector2d& half_m, const Bgr& grey) {
    RoomShape shape;
    shape.centre_px = middle_px_ + px_per_m_ * at_m;
    shape.half_px = (px_per_m_ * half_m).cwiseMax(0.4);
    shape.bgr_grey = grey;
    return shape;
  }
  Bgr Surface(double hue_deg, double saturation, double reflectance) const {
    return Times(HueColour(hue_deg, saturation), painter_->surface_grey() * light_ * reflectance);
  }
  Bgr Lamp(double hue_deg, double saturation, double cd_m2) const {
    return Times(HueColour(hue_deg, saturation), painter_->grey_per_cd_m2() * cd_m2);
  }
  void Paint(const RoomShape& shape) { painter_->Paint(shape); }
  void Box(const Eigen::Vector2d& at_m, const Eigen::Vector2d& half_m, const Bgr& grey) {
    Paint(Shape(at_m, half_m, grey));
  }

 private:
  RoomPainter* const painter_;
  RandomStream* const random_;
  double px_per_m_ = 0;
  Eigen::Vector2d middle_px_;
  double light_ = 1;
};

void PaintShelf(Piece piece) {
  RandomStream& random = piece.random();
  const Eigen::Vector2d half_m(random.Uniform(0.4, 1.0), random.Uniform(0.5, 1.1));
  const double board_hue_deg = random.Uniform(20, 40), board = random.Uniform(0.2, 0.6);
  piece.Box({0, 0}, half_m, piece.Surface(board_hue_deg, 0.5, 0.25 * board));
  const int rows = 3 + static_cast<int>(random.Uniform() * 3);
  const double row_m = 2 * half_m.y() / rows;
  for (int row = 0; row < rows; ++row) {
    const double floor_m = -half_m.y() + (row + 1) * row_m;
    double x_m = -half_m.x() + 0.02;
    while (x_m < half_m.x() - 0.03) {
      const double width_m = random.Uniform(0.015, 0.06), gap_m = random.Uniform() < 0.1 ? 0.15 : 0;
      const double height_m = std::min(0.9 * row_m, random.Uniform(0.17, 0.32));
      const bool orange = random.Uniform() < 0.2;
      const double hue_deg = orange ? random.Uniform(10, 40) : random.Uniform(0, 360);
      RoomShape book = piece.Shape(
          {x_m + 0.5 * width_m, floor_m - 0.5 * height_m}, {0.5 * width_m, 0.5 * height_m},
          piece.Surface(hue_deg, random.Uniform(0.1, 0.9), random.LogUniform(0.05, 0.75)));
      book.shade = {0, random.Uniform(-0.3, 0)};
      piece.Paint(book);
      if (random.Uniform() < 0.4) {
        const double label_m = random.Uniform(0.2, 0.8);
        piece.Box({x_m + 0.5 * width_m, floor_m - label_m * height_m}, {0.3 * width_m, 0.015},
                  piece.Surface(random.Uniform(0, 60), random.Uniform(0, 0.8), 0.8));
      }
      x_m += width_m + gap_m;
    }
    RoomShape edge =
        piece.Shape({0, floor_m}, {half_m.x(), 0.012}, piece.Surface(board_hue_deg, 0.45, board));
    edge.grain_px = random.Uniform(4, 12);
    piece.Paint(edge);
  }
}

void PaintWindow(Piece piece) {
  RandomStream& random = piece.random();
  const Eigen::Vector2d half_m(random.Uniform(0.4, 1.0), random.Uniform(0.5, 0.9));
  const double sky_cd_m2 = random.LogUniform(800, 12000);
  RoomShape sky = piece.Shape(
      {0, 0}, half_m, piece.Lamp(random.Uniform(190, 230), random.Uniform(0, 0.25), sky_cd_m2));
  sky.glows = true;
  sky.shade = {random.Uniform(-0.2, 0.2), random.Uniform(-0.5, 0)};
  piece.Paint(sky);
  // Houses and trees: darker than the sky, often still brighter than the room.
  const int outside = 2 + static_cast<int>(random.Uniform() * 5);
  for (int i = 0; i < outside; ++i) {
    const Eigen::Vector2d at_m(random.Uniform(-0.7, 0.7) * half_m.x(),
                               random.Uniform(0.2, 0.7) * half_m.y());
    const Eigen::Vector2d size_m(random.Uniform(0.1, 0.28) * half_m.x(),
                                 random.Uniform(0.1, 0.28) * half_m.y());
    const bool tree = random.Uniform() < 0.5;
    RoomShape thing =
        piece.Shape(at_m, size_m,
                    piece.Lamp(tree ? random.Uniform(60, 120) : random.Uniform(10, 50),
                               random.Uniform(0.2, 0.6), sky_cd_m2 * random.LogUniform(0.02, 0.3)));
    thing.round = tree;
    thing.cloth = tree ? 0.4 : 0;
    piece.Paint(thing);
  }
  const Bgr frame = piece.Surface(random.Uniform(0, 360), 0.05, random.Uniform(0.3, 0.8));
  const double bar_m = random.Uniform(0.02, 0.05);
  for (const double side : {-1.0, 1.0}) {
    piece.Box({side * half_m.x(), 0}, {bar_m, half_m.y() + bar_m}, frame);
    piece.Box({0, side * half_m.y()}, {half_m.x() + bar_m, bar_m}, frame);
  }
  const int panes = 1 + static_cast<int>(random.Uniform() * 3);
  for (int i = 1; i < panes; ++i) {
    piece.Box({half_m.x() * (2.0 * i / panes - 1), 0}, {0.7 * bar_m, half_m.y()}, frame);
  }
  if (random.Uniform() < 0.3) {
    // Blinds, half drawn.
    const Bgr slat = piece.Surface(random.Uniform(20, 60), 0.1, 0.7);
    const double depth_m = random.Uniform(0.3, 1.4) * half_m.y();
    for (double y_m = 0; y_m < depth_m; y_m += 0.05) {
      piece.Box({0, y_m - half_m.y()}, {half_m.x(), 0.016}, slat);
    }
  }
}

void PaintScreen(Piece piece) {
  RandomStream& random = piece.random();
  const Eigen::Vector2d half_m(random.Uniform(0.2, 0.4), random.Uniform(0.14, 0.22));
  piece.Box({0, 0}, half_m + Eigen::Vector2d(0.012, 0.012), piece.Surface(0, 0, 0.04));
  const double cd_m2 = random.LogUniform(60, 400);
  const bool dark = random.Uniform() < 0.4;
  piece.Box({0, 0}, half_m, piece.Lamp(random.Uniform(0, 360), 0.1, dark ? 0.03 * cd_m2 : cd_m2));
  const int parts = 6 + static_cast<int>(random.Uniform() * 30);
  for (int i = 0; i < parts; ++i) {
    const Eigen::Vector2d size_m(random.Uniform(0.01, 0.12), random.Uniform(0.003, 0.03));
    const Eigen::Vector2d room_m = half_m - size_m;
    RoomShape part = piece.Shape(
        {random.Uniform(-1, 1) * room_m.x(), random.Uniform(-1, 1) * room_m.y()}, size_m,
        piece.Lamp(random.Uniform() < 0.3 ? random.Uniform(10, 45) : random.Uniform(0, 360),
                   random.Uniform(0, 0.9), cd_m2 * random.Uniform(0.1, 1)));
    part.round = random.Uniform() < 0.15;
    piece.Paint(part);
  }
  piece.Box({0, half_m.y() + 0.08}, {0.04, 0.06}, piece.Surface(0, 0, 0.05));
}

void PaintLamp(Piece piece) {
  RandomStream& random = piece.random();
  const double kind = random.Uniform();
  if (kind < 0.4) {
    // A panel or tube at the ceiling.
    RoomShape panel = piece.Shape(
        {0, 0}, {random.Uniform(0.15, 0.6), random.Uniform(0.03, 0.12)},
        piece.Lamp(random.Uniform(30, 60), random.Uniform(0, 0.15), random.LogUniform(1500, 8000)));
    panel.glows = true;
    const double turn_rad = random.Uniform(-0.4, 0.4);
    panel.axis = {std::cos(turn_rad), std::sin(turn_rad)};
    piece.MoveTo({panel.centre_px.x(), 0.3 * panel.centre_px.y()});
    panel.centre_px.y() *= 0.3;
    piece.Paint(panel);
  } else if (kind < 0.7) {
    // A warm lamp with its shade.
    RoomShape shade = piece.Shape(
        {0, 0}, {random.Uniform(0.06, 0.16), random.Uniform(0.05, 0.12)},
        piece.Lamp(random.Uniform(22, 42), random.Uniform(0.3, 0.7), random.LogUniform(200, 3000)));
    shade.round = random.Uniform() < 0.5;
    shade.glows = true;
    shade.shade = {0, random.Uniform(-0.4, 0.4)};
    piece.Paint(shade);
    piece.Box({0, 0.35}, {0.012, 0.25}, piece.Surface(30, 0.2, 0.2));
  } else {
    // Indicator lights of a device, in a row.
    const int count = 1 + static_cast<int>(random.Uniform() * 4);
    const double step_m = random.Uniform(0.03, 0.12), turn_rad = random.Uniform(0, 3);
    piece.Box({0, 0}, {0.25, 0.12}, piece.Surface(0, 0, 0.06));
    for (int i = 0; i < count; ++i) {
      RoomShape light = piece.Shape(
          (i - 0.5 * (count - 1)) * step_m *
              Eigen::Vector2d(std::cos(turn_rad), 0.3 * std::sin(turn_rad)),
          Eigen::Vector2d::Constant(random.Uniform(0.004, 0.012)),
          piece.Lamp(random.Uniform() < 0.5 ? random.Uniform(15, 40) : random.Uniform(0, 360), 0.85,
                     random.LogUniform(100, 2000)));
      light.round = light.glows = true;
      piece.Paint(light);
    }
  }
}

void PaintPerson(Piece piece) {
  RandomStream& random = piece.random();
  const double skin_hue_deg = random.Uniform(14, 28), skin_saturation = random.Uniform(0.3, 0.6);
  const Bgr skin = piece.Surface(skin_hue_deg, skin_saturation, random.LogUniform(0.15, 0.6));
  const bool orange = random.Uniform() < 0.5;
  const Bgr shirt = piece.Surface(orange ? random.Uniform(10, 38) : random.Uniform(0, 360),
                                  random.Uniform(0.3, 0.95), random.LogUniform(0.08, 0.7));
  const Bgr trousers =
      piece.Surface(random.Uniform(0, 360), random.Uniform(0, 0.5), random.LogUniform(0.04, 0.4));
  const double lean_rad = random.Uniform(-0.15, 0.15);
  for (const double side : {-1.0, 1.0}) {
    RoomShape leg = piece.Shape({0.1 * side, 0.7}, {0.42, 0.085}, trousers);
    leg.axis = {std::sin(0.05 * side), std::cos(0.05 * side)};
    leg.cloth = 0.15;
    piece.Paint(leg);
  }
  RoomShape torso = piece.Shape({0, 0}, {0.33, 0.21}, shirt);
  torso.axis = {std::sin(lean_rad), std::cos(lean_rad)};
  torso.round = random.Uniform() < 0.6;
  torso.cloth = 0.2;
  torso.shade = {0, random.Uniform(-0.35, 0.35)};
  piece.Paint(torso);
  for (const double side : {-1.0, 1.0}) {
    // An arm from the shoulder: sleeve, forearm, hand.
    const double swing_rad = side * random.Uniform(0.1, 2.4);
    const Eigen::Vector2d along(std::sin(swing_rad), std::cos(swing_rad));
    const Eigen::Vector2d shoulder_m(0.2 * side, -0.22);
    RoomShape sleeve = piece.Shape(shoulder_m + 0.15 * along, {0.18, 0.06}, shirt);
    sleeve.axis = along;
    sleeve.round = true;
    sleeve.cloth = 0.2;
    const double bend_rad = swing_rad + random.Uniform(-0.8, 0.8);
    const Eigen::Vector2d bent(std::sin(bend_rad), std::cos(bend_rad));
    const bool bare = random.Uniform() < 0.5;
    RoomShape forearm =
        piece.Shape(shoulder_m + 0.3 * along + 0.12 * bent, {0.15, 0.045}, bare ? skin : shirt);
    forearm.axis = bent;
    forearm.round = true;
    RoomShape hand = piece.Shape(shoulder_m + 0.3 * along + 0.28 * bent, {0.055, 0.04}, skin);
    hand.axis = bent;
    hand.round = true;
    for (const RoomShape& part : {forearm, sleeve, hand}) piece.Paint(part);
  }
  RoomShape neck = piece.Shape({0, -0.36}, {0.06, 0.08}, skin);
  RoomShape head = piece.Shape({0, -0.5}, {0.085, 0.12}, skin);
  head.round = true;
  head.shade = {random.Uniform(-0.4, 0.4), -0.15};
  RoomShape hair = piece.Shape({0, -0.58}, {0.095, 0.075},
                               piece.Surface(random.Uniform(10, 40), random.Uniform(0.1, 0.7),
                                             random.LogUniform(0.03, 0.35)));
  hair.round = true;
  for (const RoomShape& part : {neck, hair, head}) piece.Paint(part);
}

// As many as `mean` on average.
template <typename PaintOne>
void PaintSome(const FrameRenderOptions& options, uint64_t kind, double mean, RoomPainter* painter,
               PaintOne paint_one) {
  RandomStream counting{options.seed, kFurniturePurpose, kind};
  const int count = static_cast<int>(std::floor(mean + counting.Uniform()));
  for (int i = 0; i < count; ++i) {
    RandomStream random{options.seed, kFurniturePurpose, kind, static_cast<uint64_t>(i + 1)};
    paint_one(Piece(painter, &random));
  }
}

}  // namespace

void PaintFurniture(const FrameRenderOptions& options, RoomPainter* painter) {
  PaintSome(options, 1, options.windows, painter, PaintWindow);
  PaintSome(options, 2, options.shelves, painter, PaintShelf);
  PaintSome(options, 3, options.screens, painter, PaintScreen);
  PaintSome(options, 4, options.lights, painter, PaintLamp);
  PaintSome(options, 5, options.people, painter, PaintPerson);
}

}  // namespace rigcal
