"""Ground points in images: where they are expected, and where their targets are.

Prediction
    A ground point X with covariance C_X appears in an image of pose (X_0, C_mc) at the pixel of
    (J.1) and (J.4) or (J.5) of `insgnss.photogrammetry.adjust`. With A, B and K the derivatives of
    that pixel by the pose (position and psi, covariance C_eo), by the point and by the interior
    orientation (covariance C_k), its error against a measurement has the covariance

        C_uv = A C_eo A^T + B C_X B^T + K C_k K^T                                         (GT.1)

    A point is not expected where it lies behind the camera, beyond the fold of the polynomial, or
    outside the format less a margin (`prediction`).
Signals
    A target is a function of its own plane, which is level: grey value of east and north of its
    centre, turned by an azimuth that need not be known. G, the first two columns of B, takes the
    plane to pixels; the template is the signal at G^-1 d, averaged over pixels and blurred
    (`signals`, `template`).
Search
    Normalised cross-correlation of the template with the window that (GT.1) gives, in steps of the
    azimuth; of pixels within the signal only, for nobody knows what lies around it (`measurement`).
Least-squares matching
    Of pixels x within the signal, with c the centre, T_s the template of blur s and M near I,

        g(x) = h_0 + h^T (x - c) + (r_0 + r^T (x - c)) T_s(M (x - c)) + error             (GT.2)

    Unknowns are c, M, log s, h_0, h, r_0, r; M and log s have weights of their own, those of what
    terrain and exterior orientation leave open. Errors weigh by Huber's function: a stain or the
    rim of a shadow is not the target. Errors next to each other are alike where the model fails;
    with score u_k = J_k e_k of pixel k and the weights b of a triangle of 4 px,

        C = N^-1 (sum over k, l of b(k - l) u_k u_l^T) N^-1                               (GT.3)

    takes the place of sigma_0^2 N^-1 where it is larger. What neighbouring pixels share, with
    variance s^2 (their mean product, less what white errors show), may move all edges at once, by
    s over the steepest slope of an edge of contrast r_0: C grows by that variance

        s^2 2 pi (blur^2 + 0.3^2) / r_0^2 I                                               (GT.4)

    A disc is known by its outline alone. Where a part of it is covered it looks shorter across the
    cover, and its centre moves by half of what is missing: with a the uneven part of M, beyond what
    its errors and slopes of the ground explain, and R its radius, by 2 a R if that is so, and not
    at all if the ground is steep. With the direction t

        C grows by 2 a^2 R^2 t t^T                                                         (GT.6)

    What tells a target from what only resembles it is the same s^2: with w^2 the variance of white
    errors and V that of the grey values, the correlation r of template and image freed from noise
    is

        r' = r / (1 - w^2 / V)^(1/2),      1 - r'^2 = about 4 s^2 / r_0^2                  (GT.5)

    and does not fall with the contrast of a target that is merely noisy (`matching`).
Shadow
    Where (GT.2) leaves much, it is tried again with a shadow that takes the share k of the light
    beyond a straight rim. Light falls before the camera blurs: T_s is that of the product of signal
    and light. The shadow stays if it explains 40 % of what was left.
Rules
    A match is rejected by correlation, contrast, the second best place, deformation, sigma and
    distance from the prediction (`measurement`); a point by the images that see it together
    (`neighbours`).

============ =====================================================================================
prediction   pixels of ground points with their covariance, and whether they are seen
signals      quadrant pattern, disc, cross, picture
template     a signal to the scale and the rotation of an image
search       normalised cross-correlation
matching     least-squares matching with its covariance
measurement  one target in one image, with the rules that reject it
neighbours   the images of one point against each other
============ =====================================================================================

Sources: Ackermann (1984), Digital image correlation; Gruen (1985), Adaptive least squares
correlation; Conley (1999), GMM estimation with cross sectional dependence, for (GT.3).
"""
