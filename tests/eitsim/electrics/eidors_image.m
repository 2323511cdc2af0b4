% Writes eidors_image.mat with EIDORS 3.10 in Octave 7.3: an image, and the readings that EIDORS solves for it.
fmdl = mk_common_model('b2c0', 16).fwd_model;
for k = 1:16                       % one edge of the boundary each, in place of points
   at = find(any(fmdl.boundary == fmdl.electrode(k).nodes, 2), 1);
   fmdl.electrode(k).nodes = fmdl.boundary(at, :);
   fmdl.electrode(k).z_contact = 0.01 * k;
end
fmdl.stimulation = mk_stim_patterns(16, 1, [0, 1], [0, 1], {'rotate_meas'}, 0.005);
fmdl.solve = 'fwd_solve_1st_order';
fmdl.system_mat = 'system_mat_1st_order';
fmdl.jacobian = 'jacobian_adjoint';
img = mk_image(fmdl, 1);
img.elem_data = 1 + 0.5 * cos(1:size(fmdl.elems, 1))';
meas = fwd_solve(img).meas;
save('-v7', 'eidors_image.mat', 'img', 'meas');
