//! A bounding-volume hierarchy over triangles, for closest points, box overlaps and rays.
//!
//! In: vertices and triangles. The tree is built from the root down; every node splits its
//! triangles in four: at the median of their centroids along the longest axis of the centroids' box,
//! and each half again. Four boxes are tested at once, in single precision, rounded so that they
//! contain what is in them: a closest-point query waits for memory more than for arithmetic.
//!
//! Guaranteed: queries are exact, and of several equal results the one with the lowest triangle
//! index is returned, so results do not depend on the shape of the tree or the number of threads.
//! Building takes O(n log n), a closest-point query on a smooth surface O(log n).

use std::convert::Infallible;

use super::{Vec3, triangle};

/// Number of children of a node.
const CHILDREN_PER_NODE: usize = 4;

/// Smallest number of triangles in a half of a subtree for which both halves are built in
/// parallel.
const PARALLEL_SIZE: usize = 2048;

/// An axis-aligned bounding box, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing.
    pub fn empty() -> Self {
        Self {
            min: Vec3::repeat(f64::INFINITY),
            max: Vec3::repeat(f64::NEG_INFINITY),
        }
    }

    /// The smallest box that contains some points.
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        let mut aabb = Self::empty();
        for p in points {
            aabb.min = aabb.min.zip_map(p, lesser);
            aabb.max = aabb.max.zip_map(p, greater);
        }
        aabb
    }

    /// The smallest box that contains both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.zip_map(&other.min, lesser),
            max: self.max.zip_map(&other.max, greater),
        }
    }

    /// Whether the boxes have a point in common; touching counts.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|r| self.min[r] <= other.max[r] && other.min[r] <= self.max[r])
    }

    /// The squared distance from `p` to the box, mm²; 0 inside.
    pub fn squared_distance(&self, p: &Vec3) -> f64 {
        let outside = |r: usize| greater(greater(self.min[r] - p[r], p[r] - self.max[r]), 0.0);
        let [x, y, z] = [outside(0), outside(1), outside(2)];
        x * x + y * y + z * z
    }
}

/// Margin by which boxes are extended in ray queries, mm. It exceeds the rounding errors of
/// coordinates up to metres, so that no triangle is missed.
const BOX_MARGIN_MM: f64 = 1e-9;

/// A ray prepared for tests against boxes.
struct BoxRay {
    start: Vec3,
    /// The reciprocals of the direction's components.
    inverse: Vec3,
}

impl BoxRay {
    /// Whether the ray meets the box: its intervals within the three slabs overlap.
    fn meets(&self, aabb: &Aabb) -> bool {
        let (mut enters, mut leaves) = (0.0, f64::INFINITY);
        for a in 0..3 {
            let one = (aabb.min[a] - self.start[a] - BOX_MARGIN_MM) * self.inverse[a];
            let other = (aabb.max[a] - self.start[a] + BOX_MARGIN_MM) * self.inverse[a];
            enters = greater(lesser(one, other), enters);
            leaves = lesser(greater(one, other), leaves);
        }
        enters <= leaves
    }
}

/// The smaller of two numbers, the second if they cannot be compared. This is a single
/// instruction, whereas nalgebra's `inf` and `sup` branch.
#[inline]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers, the second if they cannot be compared.
#[inline]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The result of a closest-point query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// Index of the triangle that contains the point.
    pub triangle: u32,
    /// The point's barycentric coordinates in the triangle.
    pub barycentric: [f64; 3],
    /// The point itself, mm.
    pub point: Vec3,
    /// Squared distance from the queried position, mm².
    pub squared_distance: f64,
}

/// A child of a node in [`Node::children`] is a triangle's index in `order`, with this bit set, or
/// the index of a node.
const IS_TRIANGLE: u32 = 1 << 31;
/// No child.
const NO_CHILD: u32 = u32::MAX;

/// Share by which a squared distance in single precision, rounded towards zero wherever it is computed, may
/// still exceed the true one.
const SINGLE_ROUNDING_SHARE: f64 = 1e-6;

/// The largest number in single precision that is not greater.
fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x {
        near.next_down()
    } else {
        near
    }
}

/// The smallest number in single precision that is not less.
fn round_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x {
        near.next_up()
    } else {
        near
    }
}

/// Four children and their boxes, axis by axis.
#[derive(Debug, Clone)]
struct Node {
    min: [[f32; CHILDREN_PER_NODE]; 3],
    max: [[f32; CHILDREN_PER_NODE]; 3],
    children: [u32; CHILDREN_PER_NODE],
}

impl Node {
    /// A node without children, whose boxes contain nothing.
    fn empty() -> Self {
        Self {
            min: [[f32::INFINITY; CHILDREN_PER_NODE]; 3],
            max: [[f32::NEG_INFINITY; CHILDREN_PER_NODE]; 3],
            children: [NO_CHILD; CHILDREN_PER_NODE],
        }
    }

    fn set(&mut self, k: usize, child: u32, aabb: &Aabb) {
        self.children[k] = child;
        for r in 0..3 {
            self.min[r][k] = round_down(aabb.min[r]);
            self.max[r][k] = round_up(aabb.max[r]);
        }
    }

    /// The box of a child.
    fn aabb(&self, k: usize) -> Aabb {
        Aabb {
            min: Vec3::from_fn(|r, _| f64::from(self.min[r][k])),
            max: Vec3::from_fn(|r, _| f64::from(self.max[r][k])),
        }
    }

    /// The box of all children.
    fn whole(&self) -> Aabb {
        (0..CHILDREN_PER_NODE).fold(Aabb::empty(), |whole, k| whole.union(&self.aabb(k)))
    }

    /// Lower bounds of the squared distances from a point to the children, but for [`SINGLE_ROUNDING_SHARE`]; infinite
    /// for no child. `below` and `above` are the point's coordinates, rounded.
    #[inline]
    fn squared_distances(&self, below: &[f32; 3], above: &[f32; 3]) -> [f32; CHILDREN_PER_NODE] {
        let mut sums = [0.0f32; CHILDREN_PER_NODE];
        for r in 0..3 {
            for k in 0..CHILDREN_PER_NODE {
                let (low, high) = (self.min[r][k] - above[r], below[r] - self.max[r][k]);
                let outside = if low > high { low } else { high };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                sums[k] += outside * outside;
            }
        }
        sums
    }
}

/// A node some of whose children are triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leaf(u32);

/// The tree. It has its own copy of the corners, in the order of the leaves, which are therefore
/// close together in memory.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Parents come before their children, and earlier children, with all that is below them, before
    /// later ones.
    nodes: Vec<Node>,
    /// The triangles in the order of the leaves.
    order: Vec<u32>,
    /// The place of each triangle in `order`.
    slots: Vec<u32>,
    /// The corners of the triangles, in the order of the leaves.
    corners: Vec<[Vec3; 3]>,
}

impl Bvh {
    /// Builds the tree over `triangles`, which are indices into `vertices`.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let always = || Ok::<(), Infallible>(());
        let Ok(tree) = Self::new_while(vertices, triangles, always);
        tree
    }

    /// [`Bvh::new`] over so many triangles that it takes long: ends soon after `go_on` returns an error, with that.
    ///
    /// # Errors
    /// The error of `go_on`.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn new_while<E: Send>(
        vertices: &[Vec3],
        triangles: &[[u32; 3]],
        go_on: impl Fn() -> Result<(), E> + Sync,
    ) -> Result<Self, E> {
        let corners: Vec<[Vec3; 3]> = triangles
            .iter()
            .map(|t| t.map(|v| vertices[v as usize]))
            .collect();
        let mut items: Vec<Item> = (0..)
            .zip(&corners)
            .map(|(triangle, [a, b, c])| {
                let centroid = (a + b + c) / 3.0;
                Item {
                    centroid: [0, 1, 2].map(|r| centroid[r] as f32),
                    triangle,
                }
            })
            .collect();
        let mut nodes = Vec::with_capacity(triangles.len() / 2 + 1);
        if !items.is_empty() {
            build(&mut nodes, &mut items, 0, &corners, &go_on)?;
        }
        let order: Vec<u32> = items.iter().map(|item| item.triangle).collect();
        let corners = order.iter().map(|&t| corners[t as usize]).collect();
        let mut slots = vec![0; order.len()];
        for (slot, &t) in (0..).zip(&order) {
            slots[t as usize] = slot;
        }
        Ok(Self {
            nodes,
            order,
            slots,
            corners,
        })
    }

    /// Moves the tree to other `vertices` and `triangles`, as many as before, in a fraction of the time of
    /// building it. Queries are as exact, and as fast as long as each triangle stays near its place.
    ///
    /// # Panics
    /// If the number of triangles differs, or an index is out of range.
    pub fn refit(&mut self, vertices: &[Vec3], triangles: &[[u32; 3]]) {
        assert_eq!(
            triangles.len(),
            self.order.len(),
            "as many triangles as before"
        );
        for (corners, &t) in self.corners.iter_mut().zip(&self.order) {
            *corners = triangles[t as usize].map(|v| vertices[v as usize]);
        }
        // Parents come before their children.
        for index in (0..self.nodes.len()).rev() {
            for k in 0..CHILDREN_PER_NODE {
                let child = self.nodes[index].children[k];
                if child == NO_CHILD {
                    continue;
                }
                let aabb = if child & IS_TRIANGLE != 0 {
                    Aabb::around(&self.corners[(child & !IS_TRIANGLE) as usize])
                } else {
                    self.nodes[child as usize].whole()
                };
                self.nodes[index].set(k, child, &aabb);
            }
        }
    }

    /// The point of all triangles that is closest to `p`; `None` only for an empty tree.
    pub fn closest(&self, p: &Vec3) -> Option<Closest> {
        self.closest_where(p, |_| true)
    }

    /// The closest point on the triangles for which `admits` is true, for example those that face
    /// the right way, to exclude the opposite side of a thin wall. `None` if there are none.
    pub fn closest_where(&self, p: &Vec3, admits: impl Fn(u32) -> bool) -> Option<Closest> {
        self.closest_from(p, None, admits)
    }

    /// [`closest_where`](Self::closest_where) with a guess: a triangle that is probably near `p`,
    /// such as the result for a neighbouring point. The guess affects the time but not the
    /// result; one that is not a triangle of the tree is ignored.
    pub fn closest_from(
        &self,
        p: &Vec3,
        guess: Option<u32>,
        admits: impl Fn(u32) -> bool,
    ) -> Option<Closest> {
        let guessed = guess.filter(|t| (*t as usize) < self.slots.len() && admits(*t));
        let mut best = guessed.map(|t| self.closest_in(self.slots[t as usize] as usize, p));
        let (below, above) = (
            [0, 1, 2].map(|r| round_down(p[r])),
            [0, 1, 2].map(|r| round_up(p[r])),
        );
        let limit = |best: &Option<Closest>| {
            best.map_or(f32::INFINITY, |found| {
                round_up(found.squared_distance * (1.0 + SINGLE_ROUNDING_SHARE))
            })
        };
        let mut bound = limit(&best);
        // The depth is at most log4 of 2^31 triangles, and each level adds three waiting nodes.
        let mut stack = [(0u32, 0.0f32); 64];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let (index, distance) = stack[height];
            if distance > bound {
                continue;
            }
            let node = &self.nodes[index as usize];
            let distances = node.squared_distances(&below, &above);
            let first = height;
            for k in 0..CHILDREN_PER_NODE {
                let child = node.children[k];
                if child == NO_CHILD || distances[k] > bound {
                    continue;
                }
                if child & IS_TRIANGLE != 0 {
                    if self.improve((child & !IS_TRIANGLE) as usize, p, &admits, &mut best) {
                        bound = limit(&best);
                    }
                    continue;
                }
                // The nearest child comes last, and is taken first.
                let mut place = height;
                while place > first && stack[place - 1].1 < distances[k] {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = (child, distances[k]);
                height += 1;
            }
        }
        best
    }

    /// Replaces `best` by the closest point on the triangle in a slot, if that is admitted and nearer or, at
    /// the same distance, a lower triangle. Returns whether it did.
    #[inline]
    fn improve(
        &self,
        slot: usize,
        p: &Vec3,
        admits: &impl Fn(u32) -> bool,
        best: &mut Option<Closest>,
    ) -> bool {
        if !admits(self.order[slot]) {
            return false;
        }
        let found = self.closest_in(slot, p);
        let is_nearer = best.is_none_or(|known| {
            found.squared_distance < known.squared_distance
                || (found.squared_distance == known.squared_distance
                    && found.triangle < known.triangle)
        });
        if is_nearer {
            *best = Some(found);
        }
        is_nearer
    }

    /// The closest point on the triangle in a slot.
    #[inline]
    fn closest_in(&self, slot: usize, p: &Vec3) -> Closest {
        let [a, b, c] = &self.corners[slot];
        let [u, v, w] = triangle::closest_barycentric(p, a, b, c);
        let point = a * u + b * v + c * w;
        Closest {
            triangle: self.order[slot],
            barycentric: [u, v, w],
            point,
            squared_distance: (point - p).norm_squared(),
        }
    }

    /// The leaves, in the order of the tree.
    pub fn leaves(&self) -> Vec<Leaf> {
        (0..self.nodes.len() as u32)
            .filter(|&n| self.own_slots(&self.nodes[n as usize]).next().is_some())
            .map(Leaf)
            .collect()
    }

    /// Calls `visit` with the pairs of triangles, lower index first, whose bounding boxes overlap and of which
    /// one is in `leaf` and the other in it, too, or comes later in the tree. Over all leaves that is every such
    /// pair once. One search for all triangles of a leaf is several times as fast as one for each.
    pub fn for_each_pair_from(&self, leaf: Leaf, mut visit: impl FnMut(u32, u32)) {
        let Leaf(own) = leaf;
        let mut triangles = [(0usize, Aabb::empty()); CHILDREN_PER_NODE];
        let mut count = 0;
        let mut aabb = Aabb::empty();
        for slot in self.own_slots(&self.nodes[own as usize]) {
            let of_slot = Aabb::around(&self.corners[slot]);
            aabb = aabb.union(&of_slot);
            triangles[count] = (slot, of_slot);
            count += 1;
        }
        let triangles = &triangles[..count];
        let low = [0, 1, 2].map(|r| round_down(aabb.min[r]));
        let high = [0, 1, 2].map(|r| round_up(aabb.max[r]));
        let mut stack = [0u32; 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let node = &self.nodes[stack[height] as usize];
            // All below a child ends before the next node does: earlier leaves have had their turn.
            let mut next = NO_CHILD;
            for k in (0..CHILDREN_PER_NODE).rev() {
                let child = node.children[k];
                if child == NO_CHILD {
                    continue;
                }
                let is_node = child & IS_TRIANGLE == 0;
                let is_past = is_node && next <= own;
                if is_node {
                    next = child;
                }
                let apart = (0..3).any(|r| node.min[r][k] > high[r] || node.max[r][k] < low[r]);
                if is_past || apart {
                    continue;
                }
                if is_node {
                    stack[height] = child;
                    height += 1;
                    continue;
                }
                let other = (child & !IS_TRIANGLE) as usize;
                let of_other = Aabb::around(&self.corners[other]);
                for (slot, of_slot) in triangles {
                    if *slot < other && of_slot.overlaps(&of_other) {
                        let (s, t) = (self.order[*slot], self.order[other]);
                        visit(s.min(t), s.max(t));
                    }
                }
            }
        }
    }

    /// The places in `order` of the triangles that are children of a node.
    fn own_slots<'a>(&self, node: &'a Node) -> impl Iterator<Item = usize> + use<'a> {
        let is_triangle = |child: &&u32| **child != NO_CHILD && **child & IS_TRIANGLE != 0;
        let triangles = node.children.iter().filter(is_triangle);
        triangles.map(|child| (child & !IS_TRIANGLE) as usize)
    }

    /// Calls `visit` with every triangle whose bounding box the ray from `start` in `direction`
    /// meets, in the order of the tree: all those that the ray itself may meet.
    pub fn for_each_along(&self, start: &Vec3, direction: &Vec3, mut visit: impl FnMut(u32)) {
        let ray = BoxRay {
            start: *start,
            inverse: direction.map(|x| 1.0 / x),
        };
        let mut stack = [0u32; 64];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let child = stack[height];
            if child & IS_TRIANGLE != 0 {
                let slot = (child & !IS_TRIANGLE) as usize;
                if ray.meets(&Aabb::around(&self.corners[slot])) {
                    visit(self.order[slot]);
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            for k in (0..CHILDREN_PER_NODE).rev() {
                if node.children[k] != NO_CHILD && ray.meets(&node.aabb(k)) {
                    stack[height] = node.children[k];
                    height += 1;
                }
            }
        }
    }
}

/// A triangle while the tree is built. Its place decides where it goes in the tree and thus how long queries
/// take, not what they find: single precision will do.
struct Item {
    centroid: [f32; 3],
    triangle: u32,
}

/// Splits the items at the median of their centroids along the longest axis of the centroids' box.
fn halves(items: &mut [Item]) -> (&mut [Item], &mut [Item]) {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for item in items.iter() {
        for (r, &x) in item.centroid.iter().enumerate() {
            min[r] = if x < min[r] { x } else { min[r] };
            max[r] = if x > max[r] { x } else { max[r] };
        }
    }
    let extent = |r: &usize| max[*r] - min[*r];
    let axis = (0..3)
        .max_by(|a, b| extent(a).total_cmp(&extent(b)))
        .unwrap_or(0);
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |s, t| {
        (s.centroid[axis].total_cmp(&t.centroid[axis])).then(s.triangle.cmp(&t.triangle))
    });
    items.split_at_mut(middle)
}

/// Appends the subtree over `items`, whose first one has the place `offset` in the whole, and returns its
/// box.
fn build<E: Send>(
    nodes: &mut Vec<Node>,
    items: &mut [Item],
    offset: usize,
    corners: &[[Vec3; 3]],
    go_on: &(impl Fn() -> Result<(), E> + Sync),
) -> Result<Aabb, E> {
    let index = nodes.len();
    nodes.push(Node::empty());
    let count = items.len();
    if count >= PARALLEL_SIZE {
        go_on()?;
    }
    let quarters: [&mut [Item]; CHILDREN_PER_NODE] = if count <= CHILDREN_PER_NODE {
        let mut rest = items;
        std::array::from_fn(|k| {
            let (own, others) = std::mem::take(&mut rest).split_at_mut(usize::from(k < count));
            rest = others;
            own
        })
    } else {
        let (left, right) = halves(items);
        let ((a, b), (c, d)) = if left.len() < PARALLEL_SIZE {
            (halves(left), halves(right))
        } else {
            rayon::join(|| halves(left), || halves(right))
        };
        [a, b, c, d]
    };
    let mut first = offset;
    let parts = quarters.map(|quarter| {
        let part = (first, quarter);
        first += part.1.len();
        part
    });
    let mut whole = Aabb::empty();
    let mut set = |nodes: &mut Vec<Node>, k: usize, child: u32, aabb: Aabb| {
        nodes[index].set(k, child, &aabb);
        whole = whole.union(&aabb);
    };
    if count >= CHILDREN_PER_NODE * PARALLEL_SIZE {
        let apart = |(first, items): (usize, &mut [Item])| {
            let mut nodes = Vec::new();
            let aabb = build(&mut nodes, items, first, corners, go_on)?;
            Ok::<_, E>((nodes, aabb))
        };
        let [a, b, c, d] = parts;
        let ((a, b), (c, d)) = rayon::join(
            || rayon::join(|| apart(a), || apart(b)),
            || rayon::join(|| apart(c), || apart(d)),
        );
        for (k, built) in [a, b, c, d].into_iter().enumerate() {
            let (subtree, aabb) = built?;
            let child = nodes.len() as u32;
            append(nodes, subtree);
            set(nodes, k, child, aabb);
        }
        return Ok(whole);
    }
    for (k, (first, items)) in parts.into_iter().enumerate() {
        match items {
            [] => {}
            [item] => {
                let aabb = Aabb::around(&corners[item.triangle as usize]);
                set(nodes, k, first as u32 | IS_TRIANGLE, aabb);
            }
            items => {
                let child = nodes.len() as u32;
                let aabb = build(nodes, items, first, corners, go_on)?;
                set(nodes, k, child, aabb);
            }
        }
    }
    Ok(whole)
}

/// Appends a subtree that was built separately.
fn append(nodes: &mut Vec<Node>, subtree: Vec<Node>) {
    let shift = nodes.len() as u32;
    nodes.extend(subtree.into_iter().map(|mut node| {
        for child in &mut node.children {
            if *child & IS_TRIANGLE == 0 {
                *child += shift;
            }
        }
        node
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// A tree that followed its triangles finds what a new one does, however far they went.
    #[test]
    fn a_moved_tree_answers_as_a_new_one() {
        let mut mesh = shapes::torus(9.0, 3.0, 40, 17);
        let mut tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        for by in [0.0, 0.3, 20.0] {
            for (n, v) in (0..).zip(&mut mesh.vertices) {
                let t = f64::from(n);
                *v += Vec3::new((t * 1.7).sin(), (t * 0.9).cos(), (t * 2.3).sin()) * by;
            }
            mesh.triangles.swap(3, 700);
            tree.refit(&mesh.vertices, &mesh.triangles);
            let new = Bvh::new(&mesh.vertices, &mesh.triangles);
            for i in 0..300 {
                let t = f64::from(i);
                let p = Vec3::new((t * 1.1).sin(), (t * 0.7).cos(), (t * 2.9).sin()) * 14.0;
                assert_eq!(tree.closest(&p), new.closest(&p));
            }
            let pairs = |tree: &Bvh| {
                let mut pairs = Vec::new();
                for leaf in tree.leaves() {
                    tree.for_each_pair_from(leaf, |s, t| pairs.push((s, t)));
                }
                pairs.sort_unstable();
                pairs
            };
            assert_eq!(pairs(&tree), pairs(&new));
        }
    }

    #[test]
    fn closest_point_agrees_with_brute_force() {
        let mesh = shapes::torus(9.0, 3.0, 40, 17);
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        for i in 0..300 {
            let t = f64::from(i);
            let p = Vec3::new((t * 1.7).sin(), (t * 0.9).cos(), (t * 2.3).sin()) * 12.0;
            let found = bvh.closest(&p).unwrap();
            let brute = mesh
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
                    let [u, v, w] = triangle::closest_barycentric(&p, &a, &b, &c);
                    (a * u + b * v + c * w - p).norm_squared()
                })
                .fold(f64::INFINITY, f64::min);
            assert_eq!(found.squared_distance, brute);
            for guess in [0, i as u32 * 4, 1359, u32::MAX] {
                assert_eq!(bvh.closest_from(&p, Some(guess), |_| true), Some(found));
            }
        }
    }

    #[test]
    fn the_pairs_from_all_leaves_are_the_boxes_that_touch() {
        let mesh = shapes::torus(9.0, 3.0, 40, 17);
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        let mut found = Vec::new();
        for leaf in bvh.leaves() {
            bvh.for_each_pair_from(leaf, |s, t| found.push((s, t)));
        }
        found.sort_unstable();
        let aabb = |t: u32| Aabb::around(&mesh.corners(t as usize));
        let all = 0..mesh.triangles.len() as u32;
        let expected: Vec<(u32, u32)> = (all.clone())
            .flat_map(|s| all.clone().map(move |t| (s, t)))
            .filter(|&(s, t)| s < t && aabb(s).overlaps(&aabb(t)))
            .collect();
        assert!(expected.len() > mesh.triangles.len());
        assert_eq!(found, expected);
        assert!(Bvh::new(&[], &[]).leaves().is_empty());
    }

    #[test]
    fn halves_built_in_parallel_make_the_same_tree() {
        let mesh = shapes::icosphere(5.0, 5);
        let tree = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| Bvh::new(&mesh.vertices, &mesh.triangles))
        };
        let one = tree(1);
        assert!(one.order.len() > 4 * PARALLEL_SIZE);
        let many = tree(3);
        assert_eq!(format!("{:?}", one.nodes), format!("{:?}", many.nodes));
        // Every triangle is the closest to its own centroid, so the parts fit together.
        for t in (0..mesh.triangles.len()).step_by(97) {
            let [a, b, c] = mesh.corners(t);
            let found = many.closest(&((a + b + c) / 3.0)).unwrap();
            assert_eq!(found.triangle, t as u32);
        }
    }

    #[test]
    fn ray_queries_miss_no_triangle() {
        let mesh = shapes::torus(9.0, 3.0, 40, 17);
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        let (mut met, mut asked) = (0, 0);
        for i in 0..300 {
            let t = f64::from(i);
            let start = Vec3::new((t * 1.7).sin(), (t * 0.9).cos(), (t * 2.3).sin()) * 12.0;
            // Some directions are axes, with components that are 0.
            let direction = match i % 4 {
                3 => Vec3::new((t * 0.3).cos(), (t * 1.1).sin(), (t * 0.7).cos()).normalize(),
                axis => Vec3::ith(axis as usize, 1.0),
            };
            let mut near = Vec::new();
            bvh.for_each_along(&start, &direction, |t| near.push(t));
            asked += near.len();
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(triangle);
                if triangle::ray_distance(&start, &direction, &a, &b, &c).is_some() {
                    assert!(near.contains(&(triangle as u32)), "{i}: {triangle}");
                    met += 1;
                }
            }
        }
        assert!(met > 80, "{met}");
        assert!(asked < 300 * mesh.triangles.len() / 20, "{asked}");
    }
}
