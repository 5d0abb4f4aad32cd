// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/frame_render_options.h"

#include "common/options/option_table.h"

namespace rigcal {

void AddOptions(FrameRenderOptions* options, OptionTable* table) {
  FrameRenderOptions& o = *options;
  table->Add("seed", &o.seed, {0, 4294967295}, "of the room and of all noise");
  table->Add("exposure", &o.exposure_s, {1e-5, 1, "s"}, "of a frame");
  table->Add("led_grey", &o.led_grey, {0, 5000}, "red of a lit sphere after 5 ms");
  table->Add("led_cd_m2", &o.led_cd_m2, {1, 1e6, "cd/m^2"}, "luminance of a lit sphere");
  table->Add("led_hue", &o.led_hue_deg, {0, 360, "deg"}, "hue of the LED");
  table->Add("led_saturation", &o.led_saturation, {0, 1}, "saturation of the LED");
  table->Add("blink_hz", &o.blink_hz, {0, 1e5, "Hz"},
             "if the target does not say; 0: lit all the time");
  table->Add("blink_duty", &o.blink_duty, {0.001, 1}, "share of a period in which the LED is lit");
  table->Add("blink_drift", &o.blink_drift_ppm, {-1e5, 1e5}, "of the LED's oscillator, ppm");
  table->Add("light_code", &o.light_code, {0, 8},
             "number of the wand in its light code; 0: it sends none");
  table->Add("wand_on", &o.wand_on_s, {0, 1e5, "s"}, "for how long the wand was on at the start");
  table->Add("limb", &o.limb, {0, 1}, "how much darker a sphere is at its rim");
  table->Add("led_gradient", &o.led_gradient, {0, 1},
             "change of a sphere's light from its middle to its rim, along the wand");
  table->Add("led_uneven", &o.led_uneven, {0, 0.95}, "share by which spheres differ in brightness");
  table->Add("rod", &o.rod_m, {0, 0.1, "m"}, "diameter of the stick between the spheres; 0: none");
  table->Add("held", &o.held, "a hand holds the stick");
  table->Add("defocus", &o.defocus_px, {0, 20, "px"}, "one sigma of a Gaussian");
  table->Add("defocus_disc", &o.defocus_disc_px, {0, 20, "px"}, "radius of a disc besides it");
  table->Add("vignetting", &o.vignetting, {0, 0.9}, "share of light lost in the corners");
  table->Add("bloom", &o.bloom, {0, 1}, "share of a light's grey in its halo");
  table->Add("bloom_radius", &o.bloom_radius_px, {0.5, 50, "px"}, "in which the halo falls to 1/e");
  table->Add("black", &o.black_grey, {0, 100}, "grey level without light");
  table->Add("read_noise", &o.read_noise_grey, {0, 12}, "one sigma, grey levels");
  table->Add("electrons_per_grey", &o.electrons_per_grey, {1, 1e9}, "shot noise");
  table->Add("line_delay", &o.line_delay_us, {-1000, 1000, "us"}, "of a rolling shutter, by row");
  table->Add("bayer", &o.bayer, "colours from a Bayer mosaic");
  table->Add("jpeg", &o.jpeg_quality, {0, 100}, "quality of JPEG whose loss is applied; 0: none");
  table->Add("overhead_lux", &o.overhead_lux, {0, 1e5, "lx"},
             "light from above on spheres and stick");
  table->Add("lux", &o.lux, {0, 1e5, "lx"}, "ambient light");
  table->Add("reflectance", &o.background_reflectance, {0, 1}, "of the room, on average");
  table->Add("clutter", &o.clutter, {0, 5}, "warm patches, wood, lamps; 0.5 moderate, 1 much");
  table->Add("windows", &o.windows, {0, 20}, "bright windows in the room, on average");
  table->Add("shelves", &o.shelves, {0, 20}, "shelves with books, on average");
  table->Add("screens", &o.screens, {0, 20}, "screens, on average");
  table->Add("lights", &o.lights, {0, 20}, "ceiling lights, warm lamps and indicators, on average");
  table->Add("people", &o.people, {0, 20}, "people, half of them in orange, on average");
  table->Add("reflection", &o.reflection, {0, 1}, "brightness of a mirrored wand");
  table->Add("occlusion", &o.occlusion, {0, 1}, "share of frames with a bar over one marker");
  table->Add("auto_gain", &o.auto_gain, "no more than 200 grey in red on a lit sphere");
}

absl::Status FrameRenderOptions::Validate() const {
  FaultList faults;
  CheckOptions(*this, &faults);
  // So that an exposure is made of a bounded number of flashes.
  if (blink_hz * exposure_s > 1000) {
    faults.Add("exposure ", exposure_s, " s holds more than 1000 blinks of ", blink_hz, " Hz");
  }
  return faults.Result("rendering options: ");
}

}  // namespace rigcal
