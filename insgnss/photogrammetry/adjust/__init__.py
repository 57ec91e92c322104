"""Adjustment of an image block: image observations, ground and aerial control in one system.

Unknowns
    Of every image the projection centre X_0 and the attitude C_mc (camera x right, y down, z
    viewing direction, to the axes of the block, m), whose error psi stands in the axes of m,
    C_mc(true) = exp([psi x]) C_mc; of every camera the interior orientation f, c_x, c_y, b_1, b_2,
    k_1 to k_4, p_1, p_2 (`records.block`); of every object point X; and blocks by name that
    observation groups bring (lever arm, bore-sight, time offset, shift and drift of a strip).
Image observations
    Collinearity, with the object point in the camera q and on the plane of unit distance (x, y):

        q = C_mc^T (X - X_0),    x = q_1 / q_3,    y = q_2 / q_3                          (J.1)
        dq = C_mc^T (dX - dX_0) + C_mc^T [(X - X_0) x] psi                                (J.2)

    Brown's polynomial D takes a point to the one that radial and decentring distortion make of it:

        D(x, y) = ((1 + k_1 r^2 + k_2 r^4 + k_3 r^6 + k_4 r^8) x + p_1 (r^2 + 2 x^2) + 2 p_2 x y,
                   (1 + k_1 r^2 + k_2 r^4 + k_3 r^6 + k_4 r^8) y + p_2 (r^2 + 2 y^2) + 2 p_1 x y)
                                                                                          (J.3)

    A *forward* camera (Metashape, OpenCV, COLMAP) distorts the ideal point and compares it with the
    measured pixel (u, v) on the image:

        u = c_x + (f + b_1) x' + b_2 y',    v = c_y + f y',    (x', y') = D(x, y)         (J.4)

    A *fisheye* camera (Metashape, OpenCV, COLMAP) is a forward one whose polynomial takes the
    equidistant point, as far from the axis as the ray is off it in rad:

        (a, b) = (x, y) arctan(r) / r,    (x', y') = D(a, b)                              (J.4a)

    A *backward* camera (PhotoModeler, DBAT, most programs of aerial photogrammetry) corrects the
    measured pixel and compares it with the ideal point, both in pixels; its polynomial counts in
    units of s pixels, such as the pixels of a millimetre:

        f (x, y) = s D(((1 + b_1) (u - c_x) + b_2 (v - c_y)) / s, (v - c_y) / s)          (J.5)

    Errors of the pixels enter (J.5) with their own standard deviation, as these programs have it,
    not with that which the slope of D makes of them.
    The radial part of (J.3) folds back where d(r + k_1 r^3 + ...)/dr = 0: a point beyond that
    radius, 68 deg off axis perhaps, would land within the image. Such an observation, and one whose
    point lies behind its camera, does not take part (`camera.fold_radius`).
Normal equations
    With e = observed - computed and J = d computed / d unknown the correction of the unknowns is
    that of least squares, N dx = J^T P e, N = J^T P J. Image observations are independent of each
    other; every other group brings a residual, a Jacobian over named blocks of unknowns and a dense
    weight matrix (`groups`). A point that only image observations and groups of its own see is
    eliminated (Schur complement),

        S = U - W V^-1 W^T,    s = g_x - W V^-1 g_p,    dp = V^-1 (g_p - W^T dx)          (J.6)

    with U the normal matrix of all other unknowns, V the (3 x 3) one of the point and W between
    them; a point that a group ties to other unknowns stays in S (`unknowns`).
Iteration
    Levenberg-Marquardt: the diagonals of U and V are enlarged by the factor 1 + lambda. A step that
    lowers the cost c = e^T P e is taken and lambda lowered, to zero where that does; another is
    refused and lambda raised.
    The iteration has converged where the undamped step moves no unknown by more than a thousandth
    of its standard deviation, dx^T N dx < 1e-6 sigma_0^2, or where a refused step changes c by less
    than 1e-9 c (`adjustment`).
Precision
    sigma_0^2 = e^T P e / (n - u). The cofactors of what stays are S^-1, those of an eliminated
    point, with T = W V^-1,

        Q_pp = V^-1 + T^T S^-1 T,    Q_xp = -S^-1 T                                       (J.7)

    the redundancy numbers of observations r = 1 - diag(J Q J^T P), their test w = e / (sigma
    sqrt(r)), the minimal detectable bias 4.13 sigma / sqrt(r) (Baarda; 0.1 % and 80 %), and the
    variance component of a group e^T P e / sum of r, all in `precision`. S is stored and
    solved by its envelope where images have something in common with their neighbours only (J.11).

==================== ==========================================================================
camera               (J.3) to (J.5) on arrays: rays of pixels, pixels of rays, the fold
unknowns             values of the unknowns, and where each stands in the normal matrix
groups               observation groups: poses, ground control, interior orientation
aerial               observation groups: strips of poses through the mounting
relative             observation groups: offsets and turns between the images of a strip (J.12)
kinematic            observation groups: a target that moves, and its apparent size (J.21 to J.23)
kernels              image observations: residual, Jacobian, (J.6), (J.7)
ordering             in which order images stand in the normal matrix
envelope             factor, solution and inverse of a matrix of which an envelope is stored (J.11)
normals              assembly and solution of the normal equations
adjustment           the iteration, and its result
precision            covariances, redundancy numbers, tests, variance components
direct               points from poses that are held (J.19)
start                first values: resection and forward intersection
outliers             robust weights, and rejection of gross errors by their tests
variance_components  weights that agree with the residuals
separation           unknowns that are hardly told apart, and what would separate them
==================== ==========================================================================

Sources: Brown (1971) for (J.3); Triggs et al. (2000), Bundle adjustment - a modern synthesis;
Foerstner and Wrobel (2016), Photogrammetric Computer Vision, 4.6 for tests, 15.3 for (J.6).
"""
