% Readings of a complete electrode model by EIDORS: octave-cli eidors_readings.m EIDORS FOLDER
% FOLDER/problem.mat holds nodes (m, in 2 or 3 dimensions), elems, electrode (nodes of each, a cell), z (of each, Ohm m or
% Ohm m^2) and conductivity (elements, cases); FOLDER/found.mat receives the readings of the adjacent patterns, the patterns and the CPU seconds of each case.
1;
arguments = argv();
folder = arguments{2};
cd(arguments{1});
eidors_startup;
given = load(fullfile(folder, 'problem.mat'));
model = struct('type', 'fwd_model', 'name', 'disc', 'nodes', given.nodes, 'elems', given.elems, 'gnd_node', 1, ...
               'normalize_measurements', 0, 'solve', @fwd_solve_1st_order, 'system_mat', @system_mat_1st_order);
model.boundary = find_boundary(model.elems);
for k = 1:numel(given.electrode)
  model.electrode(k).nodes = given.electrode{k}(:)';
  model.electrode(k).z_contact = given.z(k);
end
model.stimulation = mk_stim_patterns(numel(given.electrode), 1, '{ad}', '{ad}', {}, 1);
found.readings = found.seconds = [];
for k = 1:columns(given.conductivity)
  begun = cputime();
  image = mk_image(model, given.conductivity(:, k));
  data = fwd_solve(image);
  found.seconds(k) = cputime() - begun;
  found.readings(:, k) = data.meas;
end
found.currents = full([model.stimulation.stim_pattern]);
found.measured = cellfun(@full, {model.stimulation.meas_pattern}, 'UniformOutput', false);
found.version = sprintf('EIDORS %s, Octave %s', strtrim(eidors_obj('eidors_version')), version());
save('-v7', fullfile(folder, 'found.mat'), '-struct', 'found');
