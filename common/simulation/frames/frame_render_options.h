// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace rigcal {

class OptionTable;

// The appearance of a simulated frame camera and its room. The sensor is linear, 8 bits: a grey
// level is `black_grey` plus luminance (cd/m^2) times exposure times the gain at which a sphere
// whose LED blinks without any other light has `led_grey` in red after 5 ms.
//
// Light. A lit sphere is a diffuser of luminance `led_cd_m2` while its LED is on (40 mm at
// 800 cd/m^2 are 13 lumens). A surface of reflectance rho under `lux` of ambient light has
// rho * lux / pi (Lambert); the spheres' shells have 0.5 and are white, the room's mean is
// `background_reflectance`. So ambient light adds white to the LED's colour, lifts the background,
// and ends in saturation: red clips at about 1 000 lux with these defaults. `auto_gain` turns the
// gain down, as a camera with automatic gain or a stopped-down lens does. Ranges: see AddOptions.
struct FrameRenderOptions {
  uint32_t seed = 1;  // of the room and of all noise

  // Exposure.
  double exposure_s = 0.005;  // longer than one blink, as in the paper
  double led_grey = 180;      // see above; at exposure_s = 5 ms
  double led_cd_m2 = 800;
  double led_hue_deg = 24;  // orange
  double led_saturation = 0.85;
  double blink_hz = 500;  // where the target says none; 0: lit all the time
  double blink_duty = 0.5;
  double blink_drift_ppm = 0;  // of the LED's oscillator against the rig time (world only)
  // Number of the wand that the light code of the middle sphere says (light_code.h); 0: none. The
  // wand had been on for `wand_on_s` at rig time 0 (world only).
  int light_code = 0;
  double wand_on_s = 0;
  bool auto_gain = false;   // no more than 200 grey in red on an unclouded sphere
  double limb = 0.1;        // how much darker a sphere is at its rim than in its middle
  double led_gradient = 0;  // relative change of a sphere's light from its middle along the wand
  double led_uneven = 0;    // spheres differ in brightness by up to this share, either way
  double rod_m = 0;         // diameter of the stick between the spheres, and of its handle; 0: none
  bool held = false;        // by a hand in a sleeve, at the handle

  // Lens.
  double defocus_px = 0.6;     // one sigma of a Gaussian
  double defocus_disc_px = 0;  // radius of a disc besides it
  double vignetting = 0.15;    // share of light lost in the corners
  double bloom = 0;            // share of a light's grey that its halo begins with
  double bloom_radius_px = 8;  // in which the halo falls to 1/e

  // Sensor.
  double black_grey = 6;
  double read_noise_grey = 2.6;    // one sigma
  double electrons_per_grey = 40;  // shot noise: sigma^2 = grey / this
  double line_delay_us = 0;        // each row is exposed so much later than the one above it
  bool bayer = false;              // colours from a mosaic, interpolated
  double jpeg_quality = 0;         // loss of JPEG; 0: none

  // Room.
  double lux = 200;
  double overhead_lux = 0;  // light from above besides, on the spheres and the stick only
  double background_reflectance = 0.2;  // mean
  double clutter = 0;                   // 0.5 moderate, 1 much: warm patches, wood, lamps
  double windows = 0;                   // how many on average; see room_furniture.h
  double shelves = 0;
  double screens = 0;
  double lights = 0;
  double people = 0;
  double reflection = 0;  // brightness of a mirrored wand, see SceneFrame
  double occlusion = 0;   // share of frames with an opaque bar over one marker

  friend bool operator==(const FrameRenderOptions&, const FrameRenderOptions&) = default;
  // Every fault.
  absl::Status Validate() const;
};

void AddOptions(FrameRenderOptions* options, OptionTable* table);

}  // namespace rigcal
