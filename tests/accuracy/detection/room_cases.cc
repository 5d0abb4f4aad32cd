// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/room_cases.h"

namespace rigcal::accuracy {
namespace {

// A wand with a stick, in a room with people in it; light of a ceiling, a camera with a mosaic.
void MakeRoom(DetectionOptions* options) {
  FrameRenderOptions& render = options->render;
  options->share_without_wand = 1.0 / 3;
  render.clutter = 0;
  render.rod_m = 0.012;
  render.held = true;
  render.bayer = true;
  // A LED of some lumens behind 40 mm of plastic is not much brighter than a lit wall.
  render.led_cd_m2 = 300;
  render.auto_gain = true;
}

void MakeOffice(DetectionOptions* options) {
  MakeRoom(options);
  FrameRenderOptions& render = options->render;
  render.lux = 400;
  render.overhead_lux = 300;
  render.windows = 1;
  render.shelves = 1.5;
  render.screens = 1;
  render.lights = 1.5;
  render.people = 0.3;
}

}  // namespace

std::vector<DetectionCase> RoomCases(const std::vector<std::string>& photographs) {
  std::vector<DetectionCase> cases = {
      {"dark",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
       }},
      {"dark, saturated, 2 m/s",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
         options->render.led_grey = 350;
         options->pose.speed_m_s = 2;
       }},
      {"dark, LEDs uneven 35 %",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
         options->render.led_gradient = 0.35;
         options->render.led_uneven = 0.35;
       }},
      {"dark, light from above",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
         options->render.overhead_lux = 500;
       }},
      {"office", MakeOffice},
      {"bright office",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.lux = 900;
         options->render.overhead_lux = 600;
         options->render.auto_gain = true;
         options->render.windows = 2;
       }},
      {"people in orange",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.people = 4;
         options->render.windows = 0.3;
       }},
      {"near, 0.9 to 1.5 m, dim",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.lux = 80;
         options->render.overhead_lux = 60;
         options->pose.min_distance_m = 0.9;
         options->pose.max_distance_m = 1.5;
       }},
      {"office, 1 ms, 1.5 m/s",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.exposure_s = 0.001;
         options->render.led_grey *= 3;  // more gain
         options->one_clock = true;
         // The median of the middle marker in the recording of the eWand paper.
         options->pose.speed_m_s = 1.5;
       }},
      {"office, rolling, JPEG",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.line_delay_us = 15;
         options->render.jpeg_quality = 85;
         options->pose.speed_m_s = 1;
       }},
      {"office, defocus 1.5 px",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.defocus_px = 1.5;
       }},
      {"dark, JPEG",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
         options->render.jpeg_quality = 75;
       }},
      {"dark, cut by the border",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
         options->cut_by_border = true;
       }},
      {"dark, one half hidden",
       [](DetectionOptions* options) {
         MakeRoom(options);
         options->render.lux = 10;
         options->render.occlusion = 1;
       }},
      {"office, one half hidden",
       [](DetectionOptions* options) {
         MakeOffice(options);
         options->render.occlusion = 1;
       }},
  };
  for (const double lux : {300.0, 800.0}) {
    cases.push_back({lux < 500 ? "photographs, 300 lux" : "photographs, 800 lux",
                     [photographs, lux](DetectionOptions* options) {
                       MakeRoom(options);
                       options->render.lux = lux;
                       options->photographs = photographs;
                     }});
  }
  return cases;
}

}  // namespace rigcal::accuracy
