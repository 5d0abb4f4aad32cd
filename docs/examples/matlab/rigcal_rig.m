% SPDX-License-Identifier: Apache-2.0
function rig = rigcal_rig(file)
% RIGCAL_RIG  Reads the calibration.json of rigcal; MATLAB R2016b, GNU Octave 7 and later.
%   rig = RIGCAL_RIG(file) is a struct array with a camera in each element:
%     name                 within the rig
%     model                'MODEL_BROWN_CONRADY', 'MODEL_RATIONAL' or 'MODEL_FISHEYE'
%     focal, centre        1 x 2, pixels; the centre of the first pixel is (0, 0)
%     k                    coefficients in OpenCV's order, a row
%     R, t                 3 x 3 and 3 x 1, metres: x_cam = R * x_rig + t (x right, y down,
%                          z forward)
%   Errors name the file and the camera.
  handle = fopen(file, 'r');
  if handle < 0
    error('rigcal:file', 'cannot read %s', file);
  end
  text = fread(handle, [1 Inf], '*char');
  fclose(handle);
  content = jsondecode(text);
  if ~isfield(content, 'cameras') || isempty(content.cameras)
    error('rigcal:file', ['%s has no cameras: ' ...
          'rigcal calibration export ID --format json writes it'], file);
  end
  cameras = content.cameras;
  counts = struct('MODEL_BROWN_CONRADY', 5, 'MODEL_RATIONAL', 8, 'MODEL_FISHEYE', 4);
  for i = 1:numel(cameras)
    if iscell(cameras)
      camera = cameras{i};
    else
      camera = cameras(i);
    end
    lens = camera.intrinsics;
    if ~isfield(counts, lens.model)
      error('rigcal:lens', '%s: camera %s: the lens model %s is not known here; known are %s', ...
            file, camera.camera, lens.model, strjoin(fieldnames(counts)', ', '));
    end
    k = zeros(1, counts.(lens.model));
    if isfield(lens, 'distortion') && ~isempty(lens.distortion)
      if numel(lens.distortion) ~= numel(k)
        error('rigcal:lens', '%s: camera %s: %s has %d coefficients, not %d', file, ...
              camera.camera, lens.model, numel(k), numel(lens.distortion));
      end
      k = lens.distortion(:)';
    end
    if i > 1 && any(strcmp(camera.camera, {rig.name}))
      error('rigcal:file', '%s: camera %s is there twice; keep one of them', file, camera.camera);
    end
    rig(i).name = camera.camera;
    rig(i).model = lens.model;
    rig(i).focal = [value(lens, 'fx_px'), value(lens, 'fy_px')];
    rig(i).centre = [value(lens, 'cx_px'), value(lens, 'cy_px')];
    rig(i).k = k;
    pose = camera.cam_from_rig;
    q = [value(pose.rotation, 'w'), value(pose.rotation, 'x'), ...
         value(pose.rotation, 'y'), value(pose.rotation, 'z')];
    if ~(abs(norm(q) - 1) < 1e-6)
      error('rigcal:pose', '%s: camera %s: its rotation is not a unit quaternion', file, ...
            camera.camera);
    end
    % Of a unit quaternion: R = I + 2 w [v]x + 2 [v]x^2.
    v = [0 -q(4) q(3); q(4) 0 -q(2); -q(3) q(2) 0];
    rig(i).R = eye(3) + 2 * q(1) * v + 2 * v * v;
    rig(i).t = zeros(3, 1);
    if isfield(pose, 'translation_m')
      rig(i).t = [value(pose.translation_m, 'x'); value(pose.translation_m, 'y'); ...
                  value(pose.translation_m, 'z')];
    end
  end
end

function number = value(message, key)
% A field; the JSON leaves out what is 0.
  number = 0;
  if isfield(message, key)
    number = message.(key);
  end
end
